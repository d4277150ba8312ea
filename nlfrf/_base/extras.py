"""Packages that serve one part only, which are installed with an extra of this package."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


class MissingPackageError(ModuleNotFoundError):
    """A package that is not installed, with the command that installs it."""


def import_extra(name: str, extra: str, purpose: str) -> ModuleType:
    """Import a package that an extra installs.

    Parameters
    ----------
    name : str
        The module.
    extra : str
        The extra of this package that installs it.
    purpose : str
        What needs it, the subject of a sentence.

    Raises
    ------
    MissingPackageError
        It is not installed; one line that says what to do.

    Examples
    --------
    >>> import_extra("json", "tables", "reading a table").__name__
    'json'
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name.partition(".")[0]:  # installed, and one of its own is missing
            raise
        raise MissingPackageError(
            f"{purpose} needs the package {name}, which is not installed: pip install 'nlfrf[{extra}]'", name=name
        ) from None
