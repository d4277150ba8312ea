"""Types that signatures of both packages say often, under one name each; as texts, so that nothing is loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

#: What stands at one place of parsed JSON. `json` says no more, as a file may hold anything there: ask by isinstance,
#: or hold a schema against the whole before a part is taken for what the schema says.
Json: TypeAlias = Any
JsonObject: TypeAlias = dict[str, Json]
#: Where random numbers come from: a generator, a seed of one, or None for one that nobody can repeat.
Seed: TypeAlias = "np.random.Generator | int | Sequence[int] | None"
