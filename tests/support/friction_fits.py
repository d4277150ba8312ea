"""Friction read from records once: to read the same records again takes seconds and gives the same
fit.
"""

import pickle
import warnings
from hashlib import sha256

from robust.friction.reading.identification import identify_friction

#: Where the packages call `identify_friction`.
CALLERS = ("robust.servo.checking.friction", "robust.friction.reading.machine_with_friction")
_FITS = {}


def identify_once(records, **how):
    """Return what `identify_friction` returns, and warn as it does; of records that were read
    before from memory.
    """
    key = sha256(pickle.dumps((list(records), sorted(how.items())))).digest()
    if key not in _FITS:
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            fit = identify_friction(records, **how)
        _FITS[key] = fit, seen
    fit, seen = _FITS[key]
    for one in seen:
        warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
    return fit
