"""The warning for a model or a design that is usable but suspicious."""

from __future__ import annotations


class DesignWarning(UserWarning):
    """A result that is usable but suspicious: the model or the design limits what it means.

    Examples
    --------
    >>> issubclass(DesignWarning, UserWarning)  # warnings.simplefilter("error", DesignWarning) stops at each
    True
    """
