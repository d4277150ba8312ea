"""What every module of this package uses.

channels  whether a measured FRF is of one input and one output, or a matrix
options   options that several commands share
states    what was decided, as enums: stable or not, holds or is violated, the verdicts
types     types that signatures say often
warnings  a result that is usable but suspicious
"""
