"""The whole run in one HTML file to hand over: what was measured, modelled, designed and proved.

page      the file: its sections in order, of one input and output or of several
sections  sections on the controller: verdict, loop, check, worst case, settings
data      sections on what was measured and modelled
matrix    the sections of several inputs and outputs
verdicts  both verdicts side by side: of a check, of a proof for a class of friction
command   what the command reads, draws and leaves beside a report, of one kind of result or another
parts     what a section is made of: tables, pictures inside the page
same_loop whether a report is of the loop that it is told of
words     a system, its roots, a demand in words
"""
