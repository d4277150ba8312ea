"""The interactive page for loop shaping.

beginning       the controller at the start, if none is given
command         write the page from files
elements        gain and elements of the page as one state space
generated_text  the Python script and the commands on the page
page            the entry point: one HTML file, from models and a demand
widget          the same page as the output of a notebook cell
"""
