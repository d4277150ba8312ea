"""Stability of a loop: poles with a bound on their rounding errors, and the effect of a delay."""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np
from scipy.linalg import eig

from nlfrf._base.arguments import format_hertz
from nlfrf._base.values import value
from robust._base.states import Stability
from robust.lti.grids import controller_mode_lines, interpolate_frf
from robust.lti.low_frequency import Reading, read_below
from robust.lti.lti import balance_matrix, poles, response, timebase, to_s_plane
from robust.lti.norms import EPS, crossings


@value(in_sentences=True)
class StabilityResult:
    """Stability of a system, and the pole that decides it; its text is for people."""

    state: Stability
    # complex the pole nearest to the stability boundary, or farthest beyond it; nan if none is
    # named
    pole: complex = complex(np.nan, np.nan)
    of_loop: bool = False  # True for a pole of the nominal loop; the text then names the loop
    without_delay: bool = False  # True for a pole of the loop without its delay
    # True if exact arithmetic found it on the boundary or beyond it, where rounding is too large to
    # decide
    at_boundary: bool = False
    # number of unstable poles counted for a loop with its delay; 0 if a pole decides instead
    n_unstable: float = 0.0

    @property
    def stable(self) -> bool:
        """True if every pole is certainly strictly stable."""
        return self.state is Stability.STABLE

    @property
    def unstable(self) -> bool:
        """True if a pole is certainly not stable."""
        return self.state is Stability.UNSTABLE

    def __bool__(self) -> bool:
        raise TypeError("a StabilityResult is neither true nor false: use .stable or .unstable")

    def __str__(self) -> str:
        if self.stable:
            return f"{self.state}"
        named = not np.isnan(self.pole)
        where = (f" at {self.pole:.4g}" if named else "") + (
            " without its delay" if self.without_delay else ""
        )
        if self.unstable and self.n_unstable:
            what = f"the nominal loop with its delay has {self.n_unstable:g} unstable poles"
        elif self.unstable:
            beyond = ", on the stability boundary or beyond it" if self.at_boundary else ""
            what = f"{'the nominal loop has ' if self.of_loop else ''}a pole{where}{beyond}"
        elif named:
            what = (
                f"a pole{' of the nominal loop' if self.of_loop else ''}{where} lies within"
                " rounding of the stability "
            )
            what += "boundary"
        else:
            what = "with its delay the nominal loop lies within rounding of the stability boundary"
        return f"{self.state}: {what}"


def delay_pole_count(L: control.StateSpace, delay: float) -> float:
    """Return the number of poles of 1 + L exp(-s delay) that the delay [s] moves out of the left
    half plane, net.

    inf if |L| > 1 at infinite frequency, nan if rounding decides.

    >>> L = control.ss(control.tf([5], [1, 1]))
    >>> delay_pole_count(L, 0.36), delay_pole_count(L, 0.37)
    (0.0, 2.0)
    """
    direct = abs(float(L.D[0, 0]))
    found = crossings((L.A, L.B, L.C, L.D), 1.0)
    if direct > 1 or found is None:
        if direct > 1 + 1e-9:
            return np.inf
        return np.nan
    clusters = _merge_intervals(*found)
    if not clusters:
        return 0.0
    low, high = np.array(clusters).T
    between = np.concatenate([[low[0] / 2], np.sqrt(high[:-1] * low[1:]), [2 * high[-1]]])
    above = np.abs(response(L, between)) > 1
    total = 0.0
    for k, ends in enumerate(np.column_stack([np.maximum(low, high * 1e-9), high])):
        turned = (np.angle(response(L, ends)) + np.pi) % (2 * np.pi)
        passed = np.floor((ends * delay - turned) / (2 * np.pi)) + 1
        if passed[0] != passed[1]:
            return np.nan
        if low[k] > 0:
            total += 2 * passed[0] * (int(above[k]) - int(above[k + 1]))
        elif passed[0] > 0:
            return np.nan
    return float(total)


def _merge_intervals(omega: np.ndarray, moved: np.ndarray) -> list[tuple[float, float]]:
    """Return intervals that contain the crossings, with overlapping ones merged."""
    out: list[tuple[float, float]] = []
    for k in np.argsort(omega - moved):
        low, high = max(0.0, float(omega[k] - moved[k])), float(omega[k] + moved[k])
        if out and low <= out[-1][1]:
            out[-1] = (out[-1][0], max(high, out[-1][1]))
        elif high > 0:
            out.append((low, high))
    return out


def poles_with_rounding(system: control.StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Return the poles with hidden modes, and the possible shift of each by rounding."""
    return eigenvalues_with_rounding(system.A)


def eigenvalues_with_rounding(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenvalues of a real matrix, and the possible shift of each by rounding.

    States without a path back to themselves (a weight outside the loop) are treated separately:
    their poles are exact.
    """
    poles, moved = [np.zeros(0, complex)], [np.zeros(0)]
    for part in _connected_components(matrix):
        A = balance_matrix(matrix[np.ix_(part, part)])[0]
        found, left, right = eig(A, left=True, right=True)
        cosine = np.abs(np.einsum("ij,ij->j", left.conj(), right))
        poles.append(found)
        alone = A.shape[0] == 1
        moved.append(
            0.0 * cosine
            if alone
            else 100 * EPS * np.linalg.norm(A) / np.maximum(cosine, np.sqrt(EPS))
        )
    return np.concatenate(poles), np.concatenate(moved)


def _connected_components(A: np.ndarray) -> list[np.ndarray]:
    """Return the groups of states of a system that act on each other."""
    reach = ((A != 0) | np.eye(len(A), dtype=bool)).astype(np.float32)
    for _ in range(len(A).bit_length()):  # paths of twice the length each time
        reach = (reach @ reach > 0).astype(np.float32)
    if len(A):
        first = np.argmax(reach * reach.T, axis=1)
    else:
        first = np.zeros(0, int)
    return [np.flatnonzero(first == k) for k in np.unique(first)]


def assess_stability(system: control.StateSpace) -> StabilityResult:
    """Return whether every pole is stable beyond rounding, one is unstable, or rounding leaves it
    undecided.
    """
    poles, moved = poles_with_rounding(system)
    if timebase(system):
        excess = np.abs(poles) - 1
    else:
        excess = poles.real
    if not poles.size or np.all(excess < -moved):
        return StabilityResult(state=Stability.STABLE)
    worst = int(np.argmax(excess + moved))
    state = Stability.UNSTABLE if excess[worst] > moved[worst] else Stability.UNDECIDED
    return StabilityResult(state=state, pole=complex(poles[worst]))


# ---- The winding number of 1 + L about zero, counted on the lines of an FRF.

#: Largest phase step of a plant from line to line where |L| is above the second number.
LARGEST_JUMP, _SMALL_LOOP = 2 * np.pi / 3, 0.01


def unstable_poles(K: control.StateSpace, dt: float) -> int:
    """Return the number of poles of the controller strictly outside the stability region, without
    integrators.
    """
    return int(unstable_pole_values(K, dt).size)


def unstable_pole_values(K: control.StateSpace, dt: float) -> np.ndarray:
    p = poles(K)
    if dt:
        return p[np.abs(p) > 1 + 1e-9]
    return p[p.real > 1e-9 * (1 + np.abs(p))]


def winding_number(
    omega: np.ndarray,
    G: np.ndarray,
    *,
    K: control.StateSpace,
    dt: float,
    readings: Sequence[Reading] = (),
) -> tuple[int, bool]:
    """Return unstable open-loop minus closed-loop poles from 1 + G K, and whether lines and
    readings determine it.

    readings : of the plant below its first line, the likeliest first; by default those of the FRF
    without a bound.
    """
    turns, clear = windings(omega, G, K=K, dt=dt, readings=readings or read_below(omega, G))
    return turns[0], clear and len(set(turns)) == 1


def windings(
    omega: np.ndarray,
    G: np.ndarray,
    *,
    K: control.StateSpace,
    dt: float,
    readings: Sequence[Reading],
) -> tuple[tuple[int, ...], bool]:
    """Return the winding number of every reading of a plant below its first line; and True if the
    lines resolve it.
    """
    L = G * response(K, omega)
    jump = np.abs(np.angle(G[1:] / G[:-1])) > LARGEST_JUMP
    large = np.abs(L) > _SMALL_LOOP
    trusted = not np.any(jump & (large[1:] | large[:-1])) and _passes_clear_of_minus_one(L)
    # a loop above one at its last line may cross -1 beyond it, unless that line is at Nyquist
    trusted &= abs(L[-1]) < 1 or omega[-1] * dt > 0.9 * np.pi
    trusted &= bool(np.all(np.abs(to_s_plane(unstable_pole_values(K, dt), dt)) < omega[-1]))
    beyond = controller_mode_lines(
        K, (omega[-1], np.pi / dt if dt else np.inf)
    )  # where the plant is at most as large as at the end
    trusted &= bool(np.all(np.abs(G[-1] * response(K, beyond)) < max(1.0, abs(L[-1]))))
    whole = np.concatenate([readings[0].omega, omega])
    at = np.union1d(whole, controller_mode_lines(K, (whole[0], whole[-1])))
    k, n_K = response(K, at), integrator_poles(K, dt)
    turns = []
    for reading in readings:
        F = 1 + interpolate_frf(at, whole, np.concatenate([reading.G, G])) * k
        found, clear = count_half_turns(F, reading.n_integrators + n_K)
        turns.append(round(float(found)))
        trusted &= bool(clear and _is_resolved(F, np.log(at)))
    return tuple(turns), bool(trusted)


def describe_unresolved(omega: np.ndarray, F: np.ndarray, size: np.ndarray, who: str = "") -> str:
    """Describe lines that do not resolve the turns of F = 1 + L or det(I + L), (W,), and the
    options that help.

    size : (W,) |L|, or its largest singular value.

    >>> print(describe_unresolved(np.array([6.3, 12.6]), np.array([2.0, -2.0 + 2j]), np.array([1.0, 3.6])))
    ... # doctest: +NORMALIZE_WHITESPACE
    the lines do not show the winding number of 1 + L: it turns by 135 deg between 1.003 Hz and 2.005 Hz, and |L| is
    1 on the first line, 1.003 Hz, and 3.6 on the last, 2.005 Hz. Use closer lines (a longer --period), lower or higher
    lines (--f-min, --f-max), or a nominal model (robust model)
    """
    turn = np.abs(np.angle(F[1:] / F[:-1]))
    if turn.size:
        k = int(np.argmax(turn))
    else:
        k = 0
    between = " and ".join(map(format_hertz, omega[k : k + 2]))
    if turn.size:
        most = f"it turns by {np.degrees(turn[k]):.0f} deg between {between}, and "
    else:
        most = ""
    first, last = (
        f"{size[i]:.3g} on the {word}, {format_hertz(omega[i])}"
        for i, word in ((0, "first line"), (-1, "last"))
    )
    return (
        f"the lines{who} do not show the winding number of 1 + L: {most}|L| is {first}, and {last}."
        " Use closer lines (a longer --period), lower or higher lines (--f-min, --f-max), or a"
        " nominal model (robust model)"
    )


def _passes_clear_of_minus_one(L: np.ndarray) -> bool:
    """Return whether L passes -1 on a side that the lines determine, at every crossing of the
    negative real axis.

    A mode between two lines takes L along an arc. If the phase falls by d, |L| may reach
    |L|/cos(d/2) on the way; if it rises (an anti-resonance), |L| may come down to |L| cos(d/2).
    """
    turn = np.angle(L[1:] / L[:-1])
    before = np.angle(-L[:-1])
    across = before * (before + turn) < 0
    arc = np.cos(np.abs(turn) / 2)
    ends = np.abs(np.array([L[:-1], L[1:]]))
    outer = ends.max(axis=0) / np.where(turn < 0, np.maximum(arc, 1e-9), 1.0)
    inner = ends.min(axis=0) * np.where(turn < 0, 1.0, arc)
    return bool(np.all(~across | (outer < 1) | (inner > 1)))


def count_half_turns(F: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (...,) half turns of (..., W) curves F = 1 + L about zero from zero to infinite
    frequency, and if whole.

    The phase of F turns by pi for each unstable pole that is stabilised, and by another pi/2 for
    each of the n integrators of L, which count as stable. It is followed from line to line. From
    the first line it is continued to the axis on which F begins with the integrators, from the last
    one to the real axis.
    """
    steps = np.angle(F[..., 1:] / F[..., :-1])
    start = F[..., 0] * np.exp(1j * n * np.pi / 2)
    opening = np.angle(np.where(start.real > 0, start, -start))
    closing = -np.angle(np.where(F[..., -1].real > 0, F[..., -1], -F[..., -1]))
    turns = (steps.sum(axis=-1) + opening + closing) / np.pi - n / 2
    largest = np.abs(steps).max(axis=-1, initial=0.0)
    whole = np.abs(turns - np.round(turns)) < 0.01
    return turns, (largest < 2.5) & (np.maximum(np.abs(opening), np.abs(closing)) < 1.0) & whole


def integrator_poles(system: control.StateSpace, dt: float) -> int:
    """Return the number of poles at zero frequency."""
    p = poles(system)
    if dt:
        return int(np.sum(np.abs(p - 1) < 1e-6))
    return int(np.sum(np.abs(p) < 1e-9 * (1 + np.abs(p).max(initial=0))))


def _is_resolved(F: np.ndarray, x: np.ndarray) -> bool:
    """Return whether the polygon through the lines is farther from zero than the curve may bulge
    between them.

    The bulge h^2/8 |F''| is estimated from second differences over x, the logarithm of frequency,
    and doubled.
    """
    if F.size < 4:
        return False
    h, chord = np.diff(x), np.diff(F)
    slope = chord / h
    bend = 2 * np.abs(np.diff(slope)) / (h[1:] + h[:-1])
    bend = np.maximum(np.concatenate([bend[:1], bend]), np.concatenate([bend, bend[-1:]]))
    along = np.clip(-(F[:-1] * chord.conj()).real / np.maximum(np.abs(chord) ** 2, 1e-300), 0, 1)
    distance = np.abs(F[:-1] + along * chord)
    return bool(np.all(distance > 2 * h**2 / 8 * bend))
