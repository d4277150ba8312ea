"""Common types of signatures in both packages; as texts, so that nothing is loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

#: A node of parsed JSON. Its type is open, because a file may contain anything: check by
#: isinstance, or validate the whole against a schema before you use a part.
Json: TypeAlias = Any
JsonObject: TypeAlias = dict[str, Json]
#: Source of random numbers: a generator, its seed, or None for one that cannot be repeated.
Seed: TypeAlias = "np.random.Generator | int | Sequence[int] | None"
