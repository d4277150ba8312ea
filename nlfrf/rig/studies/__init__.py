"""The figures of the paper, and findings on its claims.

ensembles    the paper's experiments on its rig, and its equations (output rms, systematic part) as functions of them
figures      the figures, drawn
findings     the claims of the paper, each judged by its number
level_study  the BLA over levels of excitation
reproduce    the paper's figures and findings, written to a folder
"""
