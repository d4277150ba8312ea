"""Linear systems as state spaces: frequency response, poles and zeros."""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import control
import numpy as np
from scipy.linalg import eig, matrix_balance, schur

if TYPE_CHECKING:
    from robust._base.types import AnySystem

# ---- State spaces of python-control as pickles: for a worker in another process, never for a file.
#
# A state space is reduced to its numbers and names. The object of python-control holds functions
# that pickle refuses, so a controller could not be sent to a `ProcessPoolExecutor`. A pickle runs
# code when it is read and needs one version of python-control: for files use `robust.save`.


def _make_picklable() -> None:
    copyreg.pickle(control.StateSpace, _reduce_state_space)


def _reduce_state_space(
    system: control.StateSpace,
) -> tuple[Callable[..., control.StateSpace], tuple[object, ...]]:
    """Return a function and its arguments that rebuild the system."""
    names = {
        "inputs": system.input_labels,
        "outputs": system.output_labels,
        "states": system.state_labels,
    }
    numbers = (system.A, system.B, system.C, system.D, system.dt)
    return _rebuild_state_space, (
        numbers,
        {"name": system.name} | {key: list(labels) for key, labels in names.items()},
    )


def _rebuild_state_space(
    numbers: tuple[object, ...], names: dict[str, object]
) -> control.StateSpace:
    return control.StateSpace(*numbers, remove_useless_states=False, **names)


#: Stands for a response at a pole on the axis: its square and its products with weights are still
#: finite.
_POLE_RESPONSE = 1e140
_SCHUR_STATES = 40
SAMPLING_TOLERANCE = 1e-9  # relative difference up to which two sampling times are equal
_CHUNK_ENTRIES = (
    8000  # numbers of the matrices that are solved together, so that they stay in the cache
)
Matrices = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
_make_picklable()  # here, because every module that makes or takes a system imports this one


def with_names(
    system: control.StateSpace, inputs: Sequence[str], outputs: Sequence[str]
) -> control.StateSpace:
    """Set the names of the channels of a system, and return it."""
    system.update_names(inputs=list(inputs), outputs=list(outputs))
    return system


def signal_names(system: AnySystem) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of inputs and outputs; u1, u2, ... and y1, y2, ... if none were given."""
    pairs = ((system.input_labels, "u"), (system.output_labels, "y"))
    return tuple(  # type: ignore[return-value]  # of two
        tuple(
            f"{letter}{i + 1}" if label == f"{letter}[{i}]" else label
            for i, label in enumerate(labels)
        )
        for labels, letter in pairs
    )


def timebase(system: control.StateSpace) -> float:
    """Return the sampling time [s], zero for continuous time; a system without a stated one counts
    as continuous.
    """
    if system.dt is None:
        return 0.0
    return float(system.dt)


def is_constant(system: control.StateSpace) -> bool:
    """Return whether the system is a gain, which fits any sampling time unless it states one
    (`is_clockless`).
    """
    return system.nstates == 0


def is_clockless(system: control.StateSpace) -> bool:
    """Return whether the system is a gain without a sampling time."""
    return is_constant(system) and not timebase(system)


def sampling_times_differ(one: control.StateSpace, other: control.StateSpace) -> bool:
    """Return whether two systems state different sampling times; a gain without one fits any."""
    steps = timebase(one), timebase(other)
    differ = abs(steps[0] - steps[1]) > SAMPLING_TOLERANCE * max(steps)
    return differ and not is_clockless(one) and not is_clockless(other)


def one_sampling_time(steps: Iterable[float | None]) -> float:
    """Return the sampling time [s] that all share, 0 if none is stated; raise if two differ."""
    stated = sorted({float(step) for step in steps if step})
    if stated and stated[-1] - stated[0] > SAMPLING_TOLERANCE * stated[-1]:
        raise ValueError(
            "dt must be one sampling time for all, got"
            f" {' and '.join(f'{step:g} s' for step in stated)}"
        )
    if stated:
        return stated[0]
    return 0.0


def common_sampling_time(*systems: AnySystem) -> float | None:
    """Return the sampling time [s] of the first system that states one, 0 for continuous; None if
    any fits.

    Any sampling time fits systems without a dt, and gains and FRFs without a sampling time:
    python-control gives numbers at frequencies dt = 0, whatever their source.
    """
    for system in systems:
        gain = isinstance(system, control.FrequencyResponseData) or is_constant(system)
        if system.dt is not None and (bool(system.dt) or not gain):
            return float(system.dt)
    return None


def require_sampling_time(
    name: str, system: AnySystem, *, reference: str, wanted: float | None
) -> None:
    """Refuse a system with another sampling time than the one wanted; None accepts any."""
    mine = common_sampling_time(system)
    if (
        mine is None
        or wanted is None
        or abs(mine - wanted) <= SAMPLING_TOLERANCE * max(mine, wanted)
    ):
        return
    if mine:
        got = f"{mine:g} s"
    else:
        got = "a continuous one"
    if wanted:
        if not mine:
            got += f": robust.lti.discretize({name}, {wanted:g}) samples it"
        raise ValueError(
            f"{name} must have the sampling time of {reference}, {wanted:g} s, got {got}"
        )
    raise ValueError(f"{name} must be continuous as {reference}, got one sampled at {got}")


def response(system: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """Return (W,) complex response at omega [rad/s] (inf at a pole on the axis)."""
    return response_by_channel(system, omega)[0, 0]


def make_response(system: control.StateSpace) -> Callable[[np.ndarray], np.ndarray]:
    """Return the `response` of a system as a function, prepared for many calls."""
    dt = timebase(system)
    if dt:
        A = system.A - np.eye(system.nstates)
    else:
        A = system.A
    return partial(_siso_response, _make_evaluator(A, system.B, C=system.C, D=system.D), dt)


def _siso_response(
    at: Callable[[np.ndarray], np.ndarray], dt: float, omega: np.ndarray
) -> np.ndarray:
    """Return (W,) `response` of a prepared system."""
    return at(axis_offset(omega, dt))[:, 0, 0]


def replace_infinite(response: np.ndarray) -> np.ndarray:
    """Return (W,) a response with its limit instead of infinity: in S, T, K S and G S it cancels,
    to all digits.

    nan stays nan and counts as the worst value: it is a failure and not a pole.
    """
    return np.where(np.isinf(response), _POLE_RESPONSE, response)


def axis_points(omega: np.ndarray, dt: float) -> np.ndarray:
    """Return s = j omega, or z on the unit circle for a sampled system."""
    if dt:
        return np.exp(1j * omega * dt)
    return 1j * omega


def balance_matrix(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A scaled by powers of two so that rows and columns are alike, and the scales."""
    with np.errstate(
        invalid="ignore"
    ):  # scales beyond any integer, in which scipy looks for a permutation
        scaled, (weights, _) = matrix_balance(A, permute=False, separate=True)
    return scaled, weights


def divide_right(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return X Y^-1 of (..., n, n) matrices."""
    return np.swapaxes(np.linalg.solve(np.swapaxes(Y, -1, -2), np.swapaxes(X, -1, -2)), -1, -2)


def scale_states(
    A: np.ndarray, B: np.ndarray, C: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scale the states by powers of two, so that rows and columns of A are alike in size."""
    A, weights = balance_matrix(A)
    return A, B / weights[:, None], C * weights


def evaluate_transfer(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Return (W, n_out, n_in) transfer matrix C (s I - A)^-1 B + D at the complex points."""
    return _make_evaluator(A, B, C=C, D=D)(points)


def _make_evaluator(
    A: np.ndarray, B: np.ndarray, *, C: np.ndarray, D: np.ndarray
) -> Callable[[np.ndarray], np.ndarray]:
    """Return `evaluate_transfer` of a system as a function, prepared for many calls."""
    if A.shape[0]:
        A, B, C = scale_states(A, B, C)
        order = np.argsort(
            np.abs(np.diag(A)), kind="stable"
        )  # slow states first: elimination keeps their digits
        A, B, C = A[np.ix_(order, order)], B[order], C[:, order]
    return partial(_evaluate_direct, A, B, C, D)


def _evaluate_direct(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Return `evaluate_transfer` of a prepared system."""
    n = A.shape[0]
    points = np.atleast_1d(np.asarray(points, dtype=complex))
    out = np.empty((points.size, *D.shape), dtype=complex)
    out[:] = D
    if n == 0:
        return out
    finite = np.isfinite(points)
    if finite.all():
        known = slice(None)
    else:
        known = finite
    inside = points[known]
    if n > _SCHUR_STATES and points.size > 4:
        out[known] += _evaluate_by_schur(A, B, C=C, points=inside)
        return out
    found = np.empty((inside.size, *D.shape), dtype=complex)
    step = max(1, _CHUNK_ENTRIES // (n * n))
    pencil = np.empty((min(step, inside.size), n, n), dtype=complex)
    for first in range(0, inside.size, step):
        part = inside[first : first + step]
        here = pencil[: part.size]
        here[:] = -A
        here.reshape(part.size, n * n)[:, :: n + 1] += part[:, None]
        found[first : first + step] = _solve_pencil(here, B, C)
    out[known] += found
    return out


def _solve_pencil(pencil: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return (W, n_out, n_in) C pencil^-1 B for each of (W, n, n); inf for a singular one."""
    try:
        return np.asarray(C @ np.linalg.solve(pencil, B[None]))
    except np.linalg.LinAlgError:
        if len(pencil) == 1:
            return np.full((1, len(C), B.shape[1]), np.inf, dtype=complex)
        return np.concatenate([_solve_pencil(one[None], B, C) for one in pencil])


def _evaluate_by_schur(
    A: np.ndarray, B: np.ndarray, *, C: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Return (W, n_out, n_in) C (s I - A)^-1 B by one Schur form and back substitution at all
    points at once.

    This is for long delay lines. Solving point by point keeps more digits for modes that lie
    decades apart.
    """
    T, Q = schur(A.astype(complex), output="complex")
    right, left = Q.conj().T @ B, C @ Q
    x = np.zeros((A.shape[0], right.shape[1], points.size), dtype=complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(A.shape[0] - 1, -1, -1):
            x[k] = (right[k, :, None] + np.tensordot(T[k, k + 1 :], x[k + 1 :], 1)) / (
                points - T[k, k]
            )
    return np.moveaxis(np.tensordot(left, x, 1), 2, 0)


def frf_on_lines(nominal: control.FrequencyResponseData, omega: np.ndarray) -> np.ndarray:
    """Return the response of a nominal that is known on its lines only, on some of these lines."""
    known = np.asarray(nominal.omega)
    place = np.clip(np.searchsorted(known, omega), 0, known.size - 1)
    place = np.where(
        (place > 0) & (np.abs(known[place - 1] - omega) < np.abs(known[place] - omega)),
        place - 1,
        place,
    )
    if np.any(np.abs(known[place] - omega) > 1e-6 * omega):
        raise ValueError(
            "omega must be lines of the nominal FRF, got others: the FRF is known on its lines only"
        )
    return np.asarray(nominal.frdata[0, 0])[place]


def poles(system: control.StateSpace) -> np.ndarray:
    """Return the eigenvalues of A."""
    if system.nstates:
        return np.linalg.eigvals(system.A)
    return np.zeros(0, complex)


def is_stable(system: control.StateSpace) -> bool:
    """Return whether every pole lies strictly inside the stability region."""
    p = poles(system)
    if timebase(system):
        return bool(np.all(np.abs(p) < 1))
    return bool(np.all(p.real < 0))


def zeros(system: control.StateSpace) -> np.ndarray:
    """Return the finite invariant zeros of a system with equal numbers of inputs and outputs."""
    n, m = system.nstates, system.ninputs
    if n == 0:
        return np.zeros(0, complex)
    D = system.D
    A, B, C = scale_states(system.A, system.B, system.C)
    if np.linalg.norm(D, -2) * (1 + np.linalg.norm(A)) > 1e-8 * np.linalg.norm(C) * np.linalg.norm(
        B
    ):
        return np.linalg.eigvals(A - np.linalg.solve(D.T, B.T).T @ C)
    top = np.block([[A, B], [C, D]])
    bottom = np.zeros((n + m, n + m))
    bottom[:n, :n] = np.eye(n)
    found = eig(top, bottom, right=False, homogeneous_eigvals=True)
    finite = np.abs(found[1]) > 1e-12 * (
        np.abs(found[0]) / max(1.0, np.linalg.norm(A)) + np.abs(found[1])
    )
    return found[0][finite] / found[1][finite]


def to_s_plane(roots: np.ndarray, dt: float) -> np.ndarray:
    """Return roots in the s plane; discrete roots by the logarithm."""
    if not dt:
        return roots
    with np.errstate(divide="ignore"):
        return np.log(np.where(roots == 0, 1e-300, roots).astype(complex)) / dt


def response_by_channel(N: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """Return (n_out, n_in, W) response."""
    return np.moveaxis(frequency_response_matrices((N.A, N.B, N.C, N.D), omega, timebase(N)), 0, 2)


def frequency_response_matrices(matrices: Matrices, omega: np.ndarray, dt: float) -> np.ndarray:
    """Return (W, n_out, n_in) transfer matrix at omega [rad/s].

    A sampled system is evaluated from z - 1 and A - I: exp(j omega dt) rounds to one for small dt,
    as do slow poles.
    """
    A, B, C, D = matrices
    return evaluate_transfer(A - np.eye(A.shape[0]) if dt else A, B, C, D, axis_offset(omega, dt))


def axis_offset(omega: np.ndarray, dt: float) -> np.ndarray:
    """Return (W,) s = j omega, or z - 1 for a sampled system."""
    omega = np.atleast_1d(np.asarray(omega, dtype=float))
    if dt:
        return np.expm1(1j * omega * dt)
    return 1j * omega
