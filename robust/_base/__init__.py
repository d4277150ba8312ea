"""Definitions that every module of this package uses.

channels  tests for a measured FRF with one input and one output, or a matrix
options   options that several commands share
states    decisions as enums: stable or not, holds or is violated, the verdicts
types     types that many signatures use
warnings  `DesignWarning`, for a result that is usable but doubtful
"""
