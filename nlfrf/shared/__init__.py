"""The ground that both packages stand on; it knows nothing of records or controllers.

values        ``@value``: frozen data, checked when made
cards         a value on one line for a prompt, as a table with a picture for a notebook
arguments     refusals of bad arguments, each in one line; `DataWarning`
progress      a bar for whatever counts what it has done
plain         any value as JSON has it
wording       frequencies, counts, strange things, labelled paragraphs in words
outputs       what a command may write: never onto its inputs, nor over what no command made
whole_files   files that are written whole or not at all
strict_json   JSON from a file, held against a published schema
own_process   files read by a library that may crash, in a process of its own
command       what the two commands share: versions, warnings and refusals in one line
axes          axes, grids and decibels of every picture
transforms    long signals: a block at a time, Fourier transforms that NumPy does not name
leastsquares  small least-squares problems in many windows of lines at once
roy           the law of the largest singular value of a matrix of estimates
"""
