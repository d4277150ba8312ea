"""`DesignWarning`: the warning about a model or a design that is usable but doubtful."""

from __future__ import annotations


class DesignWarning(UserWarning):
    """Warning about a result that can be used, but that the model or the design makes doubtful.

    Examples
    --------
    >>> issubclass(DesignWarning, UserWarning)  # warnings.simplefilter("error", DesignWarning) stops at each
    True
    """
