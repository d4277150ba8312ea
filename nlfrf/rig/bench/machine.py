"""Several coupled axes: checks of their matrices and laws, and the arrays for compiled code.

M q'' + C q' + K q + cubic springs + friction(q') = actuators @ force,    y = sensors @ q
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nlfrf._base.arguments import as_list, channel_names, require_real_array
from nlfrf._base.values import freeze_array
from nlfrf.rig.kernels import data as packing
from nlfrf.rig.laws.laws import Friction, pack_law

Laws = Sequence[Friction | None]
FIELDS = (
    "mass",
    "stiffness",
    "damping",
    "friction",
    "cubic",
    "actuators",
    "sensors",
    "inputs",
    "outputs",
)
#: Rounding of a computed matrix: numbers below this share of its largest one count as zero.
_SYMMETRY_TOLERANCE = 1e-9


def check_axes(given: Mapping[str, object]) -> dict[str, object]:
    """Check the fields of a machine with several axes; return them as read-only arrays."""
    mass = require_real_array("mass", given["mass"], ndim=2)
    n = len(mass)
    if mass.shape != (n, n) or n == 0:
        raise ValueError(f"mass must be a number or a square matrix, got shape {mass.shape}")
    _require_definite("mass", mass, least=_SYMMETRY_TOLERANCE)
    found = {"mass": mass}
    for name in ("stiffness", "damping"):
        none = np.asarray(given[name]).ndim == 0 and given[name] == 0
        found[name] = np.zeros((n, n)) if none else _require_square(name, given[name], n)
    _require_definite("stiffness", found["stiffness"], least=-_SYMMETRY_TOLERANCE)
    # the antisymmetric part is gyroscopic and dissipates no energy
    _require_definite(
        "damping", (found["damping"] + found["damping"].T) / 2, least=-_SYMMETRY_TOLERANCE
    )
    if given["cubic"] is not None:
        found["cubic"] = _require_square("cubic", given["cubic"], n)
        _require_symmetric("cubic", found["cubic"])
        if found["cubic"].min() < 0:
            raise ValueError(
                "cubic must hold springs of zero or positive stiffness, got"
                f" {found['cubic'].min():g}"
            )
    for name, axis in (("actuators", 0), ("sensors", 1)):
        found[name] = _placement_matrix(name, given[name], n=n, axis=axis)
    channels = {
        "inputs": ("F", found["actuators"].shape[1]),
        "outputs": ("x", found["sensors"].shape[0]),
    }
    names = {
        name: (
            channel_names(name, given[name], count)
            or tuple(f"{letter}{i + 1}" for i in range(count))
        )
        for name, (letter, count) in channels.items()
    }
    frozen = {name: freeze_array(part) for name, part in found.items()}
    return {**frozen, **names, "friction": _check_laws(given["friction"], n)}


def check_single_axis(given: dict[str, object]) -> dict[str, tuple[str, ...]]:
    """Return the channel names of a machine with one axis; refuse fields for several axes."""
    for name in ("cubic", "actuators", "sensors"):
        if given[name] is not None:
            raise ValueError(
                f"{name} must be left out for one axis, or mass must be a (1, 1) matrix, got {name}"
            )
    found = {}
    for name, default in (("inputs", "force"), ("outputs", "position")):
        found[name] = channel_names(name, given[name], 1) or (default,)
    return found


def _check_laws(friction: object, n: int) -> tuple[Friction | None, ...]:
    """Check that there is a law or None for each axis."""
    laws: list[Any] = as_list(friction)
    if len(laws) != n:
        raise ValueError(
            f"friction must be a list with a law or None for each of the {n} axes, got {len(laws)}"
        )
    for i, law in enumerate(laws):
        if law is not None and pack_law(law)[0].form == packing.OWN:
            raise ValueError(
                f"friction[{i}] must be one of the laws of nlfrf.friction for several axes, got"
                " OwnFriction"
            )
    return tuple(laws)


def _require_square(name: str, matrix: object, n: int) -> np.ndarray:
    """Return an (n, n) matrix as an array."""
    if (shape := np.asarray(matrix).shape) != (n, n):
        raise ValueError(f"{name} must have the shape of mass, ({n}, {n}), got shape {shape}")
    return require_real_array(name, matrix, ndim=2)


def _placement_matrix(name: str, given: object, *, n: int, axis: int) -> np.ndarray:
    """Return the matrix of actuators or sensors: one row (axis 0) or column (axis 1) for each axis
    of the machine.
    """
    if given is None:
        return np.eye(n)
    matrix = require_real_array(name, given, ndim=2)
    if matrix.shape[axis] != n or 0 in matrix.shape:
        raise ValueError(
            f"{name} must have {n} {('rows', 'columns')[axis]}, one per axis, got shape"
            f" {matrix.shape}"
        )
    if not np.abs(matrix).max(axis=axis).all():
        raise ValueError(f"{name} must act on some axis with every channel, got a channel of zeros")
    return matrix


def _require_symmetric(name: str, matrix: np.ndarray) -> None:
    """Refuse a matrix that is not its own transpose."""
    off = np.abs(matrix - matrix.T).max()
    if off > _SYMMETRY_TOLERANCE * np.abs(matrix).max():
        raise ValueError(
            f"{name} must be symmetric, got a matrix that differs from its transpose by up to"
            f" {off:.3g}"
        )


def _require_definite(name: str, matrix: np.ndarray, *, least: float) -> None:
    """Refuse a matrix that is not symmetric, or has an eigenvalue below `least` times its largest
    number.
    """
    _require_symmetric(name, matrix)
    values = np.linalg.eigvalsh(matrix)
    if values[0] < least * np.abs(matrix).max() or (least > 0 and values[0] <= 0):
        kind = "definite" if least > 0 else "semidefinite"
        raise ValueError(
            f"{name} must be positive {kind}, got eigenvalues from {values[0]:.3g} to"
            f" {values[-1]:.3g}"
        )


def poles(
    mass: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    friction: Sequence[Friction | None],
    gain: float,
) -> np.ndarray:
    """Return the (2 n,) poles [rad/s] of the axes with `gain` times the presliding stiffness of
    their friction.
    """
    n = len(mass)
    laws = [None if law is None else pack_law(law)[0] for law in friction]
    K0 = np.array([0.0 if law is None else gain * law.curve.K0 for law in laws])
    viscous = np.array([0.0 if law is None else gain * law.sigma1 + law.sigma2 for law in laws])
    forces = np.hstack([stiffness + np.diag(K0), damping + np.diag(viscous)])
    return np.linalg.eigvals(np.vstack([np.eye(n, 2 * n, n), -np.linalg.solve(mass, forces)]))


def stack_matrices(
    mass: np.ndarray, stiffness: np.ndarray, *, damping: np.ndarray, cubic: np.ndarray | None
) -> np.ndarray:
    """Return (4 or 5, n, n) mass, its inverse, stiffness, damping, and cubic springs if there are
    any.
    """
    parts = [mass, np.linalg.inv(mass), stiffness, damping] + ([] if cubic is None else [cubic])
    return np.stack(parts)


def pack_laws(friction: Laws) -> tuple[np.ndarray, np.ndarray]:
    """Return (n, 11) numbers of the laws, -1 first without a law, and (n, 7, E) tables or elements,
    padded.

    An element without stiffness and strength adds nothing, and a point of a table at infinity is
    never reached.
    """
    packed = [None if law is None else pack_law(law) for law in friction]
    widest = max([1, *(one[1].shape[1] for one in packed if one)])
    laws, grids = np.zeros((len(packed), 11)), np.zeros((len(packed), 7, widest))
    laws[:, 0] = -1.0
    for i, one in enumerate(packed):
        if one is None:
            continue
        law, grid = one
        laws[i] = [*law[:8], *law.curve]
        if law.curve.kind == packing.TABLE:
            grids[i, 0] = np.inf
        grids[i, : grid.shape[0], : grid.shape[1]] = grid
    return laws, grids


def stack_memories(friction: Laws) -> packing.Memory:
    """Return the memories of axes at rest: (n, N_STATES) and (n, 4, entries)."""
    packed = [pack_law(law) for law in friction if law is not None]
    entries = max(
        [1, *(packing.initial_memory(law.curve, grid).stack.shape[1] for law, grid in packed)]
    )
    return packing.Memory(
        np.zeros((len(friction), packing.N_STATES)), np.zeros((len(friction), 4, entries))
    )


def integrate_axes(
    matrices: np.ndarray,
    friction: Sequence[Friction | None],
    *,
    memory: packing.Memory,
    drive: np.ndarray,
    h: float,
    substeps: int,
) -> np.ndarray | None:
    """Integrate over forces (n, 3, axes); return (n / substeps, 4, axes), or None if the step is
    not stable.

    The four are position, velocity, z and friction force.
    """
    from nlfrf.rig.kernels.coupled import run_axes

    laws, grids = pack_laws(friction)
    out = np.empty((len(drive) // substeps, 4, len(friction)))
    stable = run_axes(
        matrices,
        laws,
        grids,
        memory.state,
        memory.stack,
        np.ascontiguousarray(drive),
        float(h),
        out,
    )
    if stable:
        return out
    return None
