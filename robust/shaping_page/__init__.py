"""A page to shape a loop in by hand, live: it runs in any browser, needs no server, and proves nothing.

page        the door: one HTML file, from models and a demand
widget      the same page as the output of a notebook cell
command     the same file, by a command that knows where its parts came from
content     what the page is told of models, demand and controller
systems     a system as the page computes with it
controller  the controller that was shaped, as a state space
words       what the page writes out: Python to paste, the command that proves

arithmetic.js does the control, view.js shows it, shape.css says how; uplot/ draws curves (MIT, its licence beside it).
"""
