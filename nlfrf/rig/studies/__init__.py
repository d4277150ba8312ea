"""The figures of the paper, and what was found beside them.

ensembles    the paper's experiments on its rig, and its equations (output rms, systematic part) as functions of them
figures      the figures, drawn
findings     what the paper found, each with its number
level_study  the BLA over levels of excitation
reproduce    the paper's figures and findings, written to a folder
"""
