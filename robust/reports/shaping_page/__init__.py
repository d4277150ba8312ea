"""The page on which a loop is shaped live.

command  the same file, by a command that knows where its parts came from
page     the door: one HTML file, from models and a demand
widget   the same page as the output of a notebook cell
words    what the page writes out: Python to paste, the command that proves
"""
