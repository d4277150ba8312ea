"""The language of a drive: its gains as a controller, a controller as its gains, feedforward, and code for a PLC.

The public names of `robust.synthesis.drive`, in one place.
"""

from robust.synthesis.drive.blocks import to_blocks, with_blocks
from robust.synthesis.drive.cascade import cascade
from robust.synthesis.drive.cures import FrictionCure, friction_cures
from robust.synthesis.drive.feedforward import (
    FeedforwardError,
    FeedforwardGains,
    compensated,
    feedforward,
    feedforward_error,
)
from robust.synthesis.drive.filters import FilterSlot, biquad, low_pass, notch
from robust.synthesis.drive.gains import DriveReading, gains
from robust.synthesis.drive.gains_file import load_gains
from robust.synthesis.drive.settings import DriveSettings
from robust.synthesis.drive.structured_text import structured_text

__all__ = [
    "DriveReading",
    "DriveSettings",
    "FeedforwardError",
    "FeedforwardGains",
    "FilterSlot",
    "FrictionCure",
    "biquad",
    "cascade",
    "compensated",
    "feedforward",
    "feedforward_error",
    "friction_cures",
    "gains",
    "load_gains",
    "low_pass",
    "notch",
    "structured_text",
    "to_blocks",
    "with_blocks",
]
