"""What every module of both packages uses: arguments, values, numbers, files, the command line.

arguments    checks of arguments, and the text of messages: counts, ratios of units, frequencies
axes         axes, grids and decibels of every picture
command      what the two commands share: versions, warnings and refusals in one line
drive_entries entries of a file that describe a drive
extras       packages that an extra installs, with the command for it
files        files written whole, none overwritten; strict JSON, checked against a schema
numbers      least squares, Fourier transforms, quantiles of the largest root
own_process  files read by a library that may crash, in a process of its own
progress     a bar for whatever counts what it has done
types        types that signatures say often
units        numbers that are written with a unit, as drives have them
values       frozen data classes, their printed text, and their fields as plain data
"""
