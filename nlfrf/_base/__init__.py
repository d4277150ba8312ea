"""Code for every module of both packages: arguments, values, numbers, files, the command line.

arguments    checks of arguments, and the text of messages: counts, ratios of units, frequencies
axes         axes, grids and decibels of every picture
command      common parts of the two commands: versions, warnings and refusals in one line
drive_entries entries of a file that describe a drive
extras       packages that an extra installs, with the command for it
files        files written whole, none overwritten
numbers      least squares, Fourier transforms, quantiles of Roy's largest root
own_process  files read by a library that may crash, in its own process
parsing      strict JSON and TOML, checked against a schema
progress     a bar for any count of finished work
types        common types of signatures
units        numbers written with a unit, as in drives
values       frozen data classes, their printed text, and their fields as plain data
"""
