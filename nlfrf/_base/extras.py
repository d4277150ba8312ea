"""Optional packages, and the extra (pip) that installs each."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


class MissingPackageError(ModuleNotFoundError):
    """A package is not installed; the message has the command that installs it."""


def import_extra(name: str, extra: str, purpose: str) -> ModuleType:
    """Import a package that an extra installs.

    Parameters
    ----------
    name : str
        Name of the module.
    extra : str
        Extra of this package that installs it.
    purpose : str
        Task that needs it, the subject of a sentence.

    Raises
    ------
    MissingPackageError
        The module is not installed; one line with the command.

    Examples
    --------
    >>> import_extra("json", "tables", "reading a table").__name__
    'json'
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if (
            error.name != name.partition(".")[0]
        ):  # it is installed, but one of its dependencies is missing
            raise
        raise MissingPackageError(
            f"{purpose} needs the package {name}, which is not installed: pip install"
            f" 'nlfrf[{extra}]'",
            name=name,
        ) from None
