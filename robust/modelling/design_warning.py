"""``DesignWarning``: what this package warns with."""

__all__ = ["DesignWarning"]


class DesignWarning(UserWarning):
    """A result that is usable but suspicious: the model or the design limits what it means.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", DesignWarning)  # to stop at every suspicious result
    """
