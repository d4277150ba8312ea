"""The page on which a loop is shaped live.

beginning       the controller to begin with where none is given
command         write the page from files, whose paths it quotes
elements        gain and elements of the page, to one state space
generated_text  the Python script and the commands that the page writes out
page            the entry point: one HTML file, from models and a demand
widget          the same page as the output of a notebook cell
"""
