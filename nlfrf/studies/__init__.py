"""Studies made of many experiments: the levels of one rig, and the paper reproduced.

level_study   the BLA over levels of excitation
reproduce     the paper's figures and findings, written to a folder
ensembles     the paper's experiments on its rig, and its equations (output rms, systematic part) as functions of them
findings      what the paper found, each with its number
side_remarks  which other signals give the same BLA
figures       the figures, drawn
"""
