"""Fits made once: to fit the same measurement again takes seconds and gives the same."""

import inspect
import pickle
import warnings
from functools import wraps
from hashlib import sha256

from robust.friction.reading.identification import identify_friction
from robust.models import scan_orders


def made_once(function):
    """Return a function that returns what this one does, and warns as it does.

    What was made before of the same arguments is taken from memory.
    """
    made, signature = {}, inspect.signature(function)

    @wraps(function)
    def once(*given, **how):
        asked = signature.bind(*given, **how)
        asked.apply_defaults()
        key = sha256(pickle.dumps(sorted(asked.arguments.items()))).digest()
        if key not in made:
            with warnings.catch_warnings(record=True) as seen:
                warnings.simplefilter("always")
                result = function(*given, **how)
            made[key] = result, seen
        result, seen = made[key]
        for one in seen:
            warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
        return result

    return once


identify_once = made_once(identify_friction)
scan_once = made_once(scan_orders)
#: Where the packages call what is made once.
CALLS = {
    "robust.servo.checking.friction.identify_friction": identify_once,
    "robust.friction.reading.machine_with_friction.identify_friction": identify_once,
    "robust.servo.checking.machine.scan_orders": scan_once,
}
