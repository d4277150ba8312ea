"""Margins of a loop: disk margins, classical margins, distances between plants."""

from robust.analysis.classical import ClassicalMargins, classical_margins
from robust.analysis.disk import DiskMargin, LoopMargins, disk_margin, disk_margins
from robust.analysis.gap import ncf_margin, nu_gap

__all__ = [
    "ClassicalMargins",
    "DiskMargin",
    "LoopMargins",
    "classical_margins",
    "disk_margin",
    "disk_margins",
    "ncf_margin",
    "nu_gap",
]
