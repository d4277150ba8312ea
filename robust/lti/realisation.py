"""Any form of a system, as one state space."""

from __future__ import annotations

import numbers
from functools import singledispatch
from typing import cast

import control
import numpy as np
from scipy.linalg import matrix_balance
from scipy.signal import lfilter

from nlfrf._base.arguments import short_form
from robust._base.types import AnySystem, LinearSystem, Weight
from robust.lti.connections import block_diagonal, in_series
from robust.lti.lti import (
    Matrices,
    common_sampling_time,
    evaluate_transfer,
    is_constant,
    is_stable,
    poles,
    require_sampling_time,
    response_by_channel,
    scale_states,
    timebase,
    with_names,
)
from robust.lti.minimal import EntryModes, sum_modes


def multivariable(name: str, system: object) -> control.StateSpace:
    """Return the system as a state space with any number of inputs and outputs, or refuse it."""
    found = _realise(system, name)
    if found is None:
        # a model or a fit, where a plant is needed
        parts = [
            part
            for part in ("nominal", "G")
            if isinstance(getattr(system, part, None), control.StateSpace)
        ]
        if parts:
            cure = f" Give its {parts[-1]}."
        else:
            cure = ""
        raise ValueError(f"{name} must be a control.StateSpace, got {short_form(system)}.{cure}")
    if found is not system and hasattr(system, "input_labels"):
        given = cast("LinearSystem", system)
        found = with_names(found, given.input_labels, given.output_labels)
    return _require_complete(name, found)


@singledispatch
def _realise(system: object, name: str) -> control.StateSpace | None:
    """Return a state space of a system, a number or a matrix; None for anything else."""
    return None


@_realise.register(control.StateSpace)
def _keep_state_space(system: control.StateSpace, name: str) -> control.StateSpace:
    return system


@_realise.register(control.TransferFunction)
def _realise_transfer_function(system: control.TransferFunction, name: str) -> control.StateSpace:
    if (system.ninputs, system.noutputs) != (1, 1):
        return _realise_transfer_matrix(name, system)
    return from_polynomials(name, system.num[0][0], den=system.den[0][0], dt=system.dt)


@_realise.register(numbers.Real)
@_realise.register(np.ndarray)
@_realise.register(list)
@_realise.register(tuple)
def _realise_gain(system: object, name: str) -> control.StateSpace:
    return control.StateSpace([], [], [], _gain_matrix(name, system), None)


@_realise.register(bool)  # no number, although Python counts it as one
def _refuse_truth(system: bool, name: str) -> None:
    return None


#: Poles closer than this, relative to their size, are summed together: poles of multiplicity 4
#: scatter by 1e-4. If the response shows that this was too close, all poles within a decade are
#: summed together, and then all poles.
_LINKED_POLES = (1e-2, 0.9, np.inf)
# of a sum, relative to the entries, at the speeds of all poles and zeros
_LARGEST_RESPONSE_ERROR = 1e-6


def _realise_transfer_matrix(name: str, system: control.TransferFunction) -> control.StateSpace:
    """Return a minimal state space of a matrix of transfer functions; refuse one that hides an
    unstable mode.

    Modes that entries share are one mode. An unstable mode that cancels within an entry would be
    lost.
    """
    shape = system.noutputs, system.ninputs
    fractions = [
        tuple(
            np.trim_zeros(np.asarray(one[row][column], float), "f")
            for one in (system.num, system.den)
        )
        for row, column in np.ndindex(shape)
    ]
    entries = [from_polynomials(name, num, den=den, dt=system.dt) for num, den in fractions]
    D = np.array([entry.D[0, 0] for entry in entries]).reshape(shape)
    speeds = np.abs(np.concatenate([np.roots(den) for _, den in fractions]))
    if speeds.any():
        speeds = speeds[speeds > 0]
    else:
        speeds = np.ones(1)
    if timebase(system):
        speed = 1.0
    else:
        speed = float(np.exp(np.mean(np.log(speeds))))
    modes = [
        EntryModes(row, column, part.A, part.B[:, 0], part.C[0], numerator)
        for (row, column), (num, den) in zip(np.ndindex(shape), fractions, strict=True)
        for part, numerator in _split_at_zero(name, num, den, speed)
        if part.nstates
    ]
    points = speeds * np.exp(1j)
    right = np.reshape(
        [np.polyval(num, points) / np.polyval(den, points) for num, den in fractions], (*shape, -1)
    )
    for link in _LINKED_POLES:
        A, B, C, lost = sum_modes(modes, shape, link)
        found = control.StateSpace(speed * A, np.sqrt(speed) * B, np.sqrt(speed) * C, D, system.dt)
        error = np.moveaxis(evaluate_transfer(found.A, found.B, found.C, D, points), 0, 2) - right
        if np.all(np.abs(error) <= _LARGEST_RESPONSE_ERROR * np.abs(right)):
            break
    hidden = np.real_if_close(
        speed * lost[np.abs(lost) >= 1 if timebase(system) else lost.real >= 0]
    )
    if hidden.size:
        raise ValueError(
            f"{name} must have no hidden unstable mode, got one that cancels at {hidden[0]:.4g}"
        )
    return with_names(found, system.input_labels, system.output_labels)


def _split_at_zero(
    name: str, num: np.ndarray, den: np.ndarray, speed: float
) -> list[tuple[control.StateSpace, np.ndarray]]:
    """Return the parts of num / den with poles at zero and elsewhere, in time times `speed`, and
    their numerators.

    The polynomials show exactly which poles are zero: n/(s^k d) = h/s^k + (n - h d)/(s^k d), h the
    series of n/d.
    """
    order = den.size - 1
    num, den = (one * speed ** (np.arange(one.size)[::-1] - float(order)) for one in (num, den))
    k = order - int(np.flatnonzero(den)[-1])
    rest = den[: den.size - k]
    if k:
        series = lfilter(np.append(num[::-1], np.zeros(k)), rest[::-1], np.eye(1, k)[0])
        others = np.polysub(num, np.polymul(series[::-1], rest))[: -k or None]
    else:
        series = np.zeros(0)
        others = num
    chain = control.StateSpace(
        np.eye(k, k=-1), np.eye(k, 1), series[None, ::-1], [[0.0]], remove_useless_states=False
    )
    return [(chain, np.ones(1)), (from_polynomials(name, others, den=rest, dt=None), others)]


def _gain_matrix(name: str, gain: object) -> np.ndarray:
    try:
        return np.atleast_2d(np.asarray(gain, dtype=float))
    except (TypeError, ValueError):
        raise ValueError(
            f"{name} must be a system, a number or a matrix of numbers, got {short_form(gain)}"
        ) from None


def state_space(name: str, system: object) -> control.StateSpace:
    """Return the system as a single-input single-output state space with all its states, or refuse
    it.

    Transfer functions are realised without cancellation, so that the stability check finds a mode
    that is hidden in G K. A number becomes a constant gain.
    """
    channels = getattr(system, "ninputs", 1), getattr(system, "noutputs", 1)
    found = _realise(system, name) if channels == (1, 1) else None
    if found is not None:
        channels = found.ninputs, found.noutputs
    if channels != (1, 1):
        raise ValueError(
            f"{name} must have one input and one output, got {channels[0]} and {channels[1]}"
        )
    if found is None:
        raise ValueError(
            f"{name} must be a control.StateSpace, a TransferFunction or a number, got"
            f" {short_form(system)}" + _controller_hint(system)
        )
    return _require_complete(name, found)


def _controller_hint(thing: object) -> str:
    """Return the hint that a design has its controller in the field K, else ""."""
    if isinstance(getattr(thing, "K", None), control.StateSpace):
        return "; its controller is its field K"
    return ""


def split_diagonal(name: str, K: control.StateSpace) -> list[control.StateSpace]:
    """Return the loops of a controller without coupling, each with the states it uses; refuse a
    coupled one.
    """
    if K.ninputs != K.noutputs:
        raise ValueError(
            f"{name} must have as many inputs as outputs, got {K.ninputs} and {K.noutputs}"
        )
    parts = {(j, i): reachable_entry(K, j, i) for j in range(K.noutputs) for i in range(K.ninputs)}
    for (j, i), part in parts.items():
        if i != j and (part.nstates or part.D[0, 0]):
            raise ValueError(
                f"{name} must be diagonal, a loop for each channel, got a coupling from"
                f" {K.input_labels[i]} to {K.output_labels[j]}"
            )
    return [parts[k, k] for k in range(K.ninputs)]


def reachable_entry(K: control.StateSpace, j: int, i: int) -> control.StateSpace:
    """Return entry (j, i) with the states that its input reaches and its output sees."""
    return structurally_minimal((K.A, K.B[:, [i]], K.C[[j]], K.D[[j]][:, [i]]), K.dt)


def structurally_minimal(matrices: Matrices, dt: float | None) -> control.StateSpace:
    """Return the system without states that A, B and C disconnect by their zeros."""
    A, B, C, D = matrices
    links, reached, seen = A != 0, (B != 0).any(axis=1), (C != 0).any(axis=0)
    for _ in range(len(A)):
        reached, seen = reached | links @ reached, seen | seen @ links
    kept = np.flatnonzero(reached & seen)
    return control.StateSpace(
        A[np.ix_(kept, kept)], B[kept], C[:, kept], D, dt, remove_useless_states=False
    )


def _require_complete(name: str, system: control.StateSpace) -> control.StateSpace:
    """Return a state space with a sampling time and finite matrices, or raise."""
    if system.dt is True and system.nstates:
        raise ValueError(f"{name} must state its sampling time, got dt=True")
    if system.dt is True:  # a discrete gain without a rate: it fits any
        names = {"inputs": system.input_labels, "outputs": system.output_labels}
        system = control.StateSpace(system.A, system.B, system.C, system.D, None, **names)
    for matrix in (system.A, system.B, system.C, system.D):
        if not np.isfinite(matrix).all():
            raise ValueError(f"{name} must have finite coefficients, got nan or infinite ones")
    return system


def repeat_over_channels(name: str, weight: Weight, n: int) -> control.StateSpace:
    """Return a weight for n signals; a weight with one channel is repeated."""
    weight = multivariable(name, weight)
    if (weight.ninputs, weight.noutputs) == (1, 1) and n > 1:
        return block_diagonal([weight] * n, weight.dt)
    if weight.ninputs != n:
        raise ValueError(
            f"{name} must have 1 input, for all channels alike, or {n}, got {weight.ninputs}"
        )
    return weight


def from_polynomials(
    name: str, num: np.ndarray, *, den: np.ndarray, dt: float | None
) -> control.StateSpace:
    """Return the controllable canonical form, in scaled time and balanced."""
    num = np.trim_zeros(np.asarray(num, float), "f")
    den = np.trim_zeros(np.asarray(den, float), "f")
    if den.size == 0 or not (np.isfinite(num).all() and np.isfinite(den).all()):
        raise ValueError(
            f"{name} must have finite coefficients and a denominator, got {num} over {den}"
        )
    if num.size > den.size:
        raise ValueError(
            f"{name} must be proper, got degree {num.size - 1} over degree {den.size - 1}"
        )
    n = den.size - 1
    num = np.concatenate([np.zeros(n + 1 - num.size), num]) / den[0]
    den = den / den[0]
    D = np.array([[num[0]]])
    if n == 0:
        return control.StateSpace([], [], [], D, dt)
    # scale = geometric mean of the nonzero roots: the polynomial in s / scale has coefficients near
    # one
    last = np.flatnonzero(den)[-1]
    if last:
        scale = abs(den[last]) ** (1 / last)
    else:
        scale = 1.0
    powers = scale ** -np.arange(1.0, n + 1)
    tail, head = den[1:] * powers, (num[1:] - num[0] * den[1:]) * powers
    A = np.zeros((n, n))
    A[0], A[1:, :-1] = -tail, np.eye(n - 1)
    B = np.zeros((n, 1))
    B[0, 0] = 1.0
    A, B, C = scale_states(A, B, head[None, :])
    _, unit = np.frexp(
        np.abs(C).max()
    )  # scaled exactly, so that the squares of the numbers do not overflow
    if np.any(C):
        level = np.sqrt(np.ldexp(np.linalg.norm(np.ldexp(C, -unit)), unit) / np.linalg.norm(B))
    else:
        level = 1.0
    return control.StateSpace(A * scale, B * level * scale, C / level, D, dt)


def from_roots(zeros: np.ndarray, poles: np.ndarray, gain: float, dt: float) -> control.StateSpace:
    """Return gain prod (s - zeros) / prod (s - poles), as a chain of sections without polynomials.

    Both sets are closed under conjugation, with at most as many zeros as poles. Slow poles of a
    discrete system crowd around z = 1. Polynomial coefficients lose them there, sections do not.
    """
    zero_pairs, zero_rest = pair_roots(zeros)
    pole_pairs, pole_rest = pair_roots(poles)
    chain = [control.StateSpace([], [], [], [[gain]], dt)]
    for pair in pole_pairs:
        mine: tuple[complex, ...] = ()
        if zero_pairs:
            mine = zero_pairs.pop(0)
        elif zero_rest and not pole_rest:
            mine = (zero_rest.pop(),)
        chain.append(_second_order_section(mine, pair, dt))
    if pole_rest:
        chain.append(_second_order_section(tuple(zero_rest), (pole_rest[0],), dt))
    return _balance_states(in_series(*chain))


def _balance_states(system: control.StateSpace) -> control.StateSpace:
    """Scale the states by powers of two, so that A, B and C are alike in size, before polynomials
    are made from them.

    A zero far outside the band leaves a B of 1e-20 and a C of 1e10, from which `tf` of SLICOT
    returned nothing.
    """
    if not system.nstates or not (system.B.any() and system.C.any()):
        return system
    bordered = np.block([[system.A, system.B], [system.C, np.zeros((1, 1))]])
    with np.errstate(over="ignore", under="ignore"):
        _, (weights, _) = matrix_balance(bordered, permute=False, separate=True)
        units = weights[: system.nstates] / weights[-1]
        A, B, C = system.A * units / units[:, None], system.B / units[:, None], system.C * units
    if not all(np.isfinite(matrix).all() for matrix in (A, B, C)):
        return system
    return control.StateSpace(A, B, C, system.D, system.dt)


def pair_roots(roots: np.ndarray) -> tuple[list[tuple[complex, ...]], list[complex]]:
    """Return conjugate pairs, then pairs of real roots in order of size; and the remaining real
    root, if any.
    """
    real, upper = _split_conjugates(roots, 1e-12)
    alone = list(real)
    pairs: list[tuple[complex, ...]] = [(complex(r), complex(np.conj(r))) for r in upper]
    if len(alone) % 2:
        rest = [complex(alone.pop(0))]
    else:
        rest = []
    return (
        pairs + [(complex(a), complex(b)) for a, b in zip(alone[::2], alone[1::2], strict=True)],
        rest,
    )


def _second_order_section(
    zeros: tuple[complex, ...], poles: tuple[complex, ...], dt: float
) -> control.StateSpace:
    """Return one section with one or two poles and at most as many zeros, with leading coefficients
    equal to one.
    """
    if len(poles) == 1:
        p = poles[0].real
        if not zeros:
            return control.StateSpace([[p]], [[1.0]], [[1.0]], [[0.0]], dt)
        return control.StateSpace([[p]], [[1.0]], [[p - zeros[0].real]], [[1.0]], dt)
    p1, p2 = poles
    direct = 1.0 if len(zeros) == 2 else 0.0
    # numerator = direct (s - p1)(s - p2) + slope (s - p2) + value, with value the numerator at p2
    slope = {2: lambda: (p1 + p2 - sum(zeros)).real, 1: lambda: 1.0, 0: lambda: 0.0}[len(zeros)]()
    # real poles: states 1/(s - p1) and 1/((s - p1)(s - p2))
    if p1.imag == 0:
        value = np.prod([p2 - z for z in zeros]).real if zeros else 1.0
        A = [[p1.real, 0.0], [1.0, p2.real]]
        return control.StateSpace(A, [[1.0], [0.0]], [[slope, value]], [[direct]], dt)
    sigma, w = p1.real, abs(p1.imag)
    # states (s - sigma)/den and w/den; numerator = direct den + slope (s - sigma) + value
    if len(zeros) == 2:
        middle, product = sum(zeros).real / 2, np.prod(zeros).real
        value = (middle - sigma) ** 2 + (product - middle**2) - w**2
    else:
        value = (sigma - zeros[0]).real if zeros else 1.0
    A = [[sigma, -w], [w, sigma]]
    return control.StateSpace(A, [[1.0], [0.0]], [[slope, value / w]], [[direct]], dt)


def stable_weight(name: str, system: Weight, *, dt: float, n: int = 1) -> control.StateSpace:
    """Return a stable weight on n signals, continuous or with the sampling time of the loop, or
    refuse it.
    """
    if n > 1:
        w = repeat_over_channels(name, system, n)
    else:
        w = state_space(name, system)
    step = timebase(w)
    if step and not is_constant(w) and abs(step - dt) > 1e-9 * step:
        if dt:
            loop = f"{dt:g} s"
        else:
            loop = "which is continuous"
        raise ValueError(
            f"{name} must be continuous or have the sampling time of the loop, {loop}, got"
            f" {step:g} s"
        )
    if not is_stable(w):
        raise ValueError(
            f"{name} must be stable, got poles {poles(w)}. Use a slow pole in place of an"
            " integrator."
        )
    return w


def rightmost_pole(system: control.StateSpace) -> complex:
    """Return the pole farthest out in the unstable direction."""
    p = poles(system)
    return complex(p[np.argmax(np.abs(p) if timebase(system) else p.real)])


def frequency_response(
    name: str,
    plant: AnySystem,
    omega: np.ndarray,
    other: tuple[AnySystem, ...] = (),
    shape: tuple[int, int] = (1, 1),
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and complex response of an FRF, or of a system on omega; refuse another
    clock than `other`.

    A system without a dt takes that clock. The response is (W,), or (n_y, n_u, W) for a shape with
    several channels.
    """
    dt = common_sampling_time(*other)
    if isinstance(plant, control.FrequencyResponseData):
        _require_fitting(name, plant, dt=dt, shape=shape)
        omega, G = np.asarray(plant.omega, dtype=float), np.asarray(plant.frdata, dtype=complex)
    else:
        system = state_space(name, plant) if shape == (1, 1) else multivariable(name, plant)
        _require_fitting(name, system, dt=dt, shape=shape)
        if system.dt is None and dt:
            system = control.StateSpace(system.A, system.B, system.C, system.D, dt)
        G = response_by_channel(system, omega)
    return omega, G[0, 0] if shape == (1, 1) else G


def _require_fitting(
    name: str, plant: AnySystem, *, dt: float | None, shape: tuple[int, int]
) -> None:
    """Refuse a plant with another sampling time than the nominal, or with other channels."""
    require_sampling_time(name, plant, reference="the nominal", wanted=dt)
    if (plant.noutputs, plant.ninputs) != shape:
        if shape == (1, 1):
            wanted = "one input and one output"
        else:
            wanted = f"{shape[1]} inputs and {shape[0]} outputs"
        raise ValueError(f"{name} must have {wanted}, got {plant.ninputs} and {plant.noutputs}")


def order_roots(roots: np.ndarray, tolerance: float = 1e-14) -> np.ndarray:
    """Return real roots, then exactly conjugate pairs with the upper one first; real up to a
    relative tolerance.
    """
    real, upper = _split_conjugates(roots, tolerance)
    return np.concatenate([real + 0j, np.column_stack([upper, upper.conj()]).ravel()])


def _split_conjugates(roots: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return real roots and upper complex roots of a real polynomial, sorted."""
    roots = np.asarray(roots, dtype=complex)
    real = np.abs(roots.imag) <= tolerance * np.abs(roots)
    return np.sort(roots[real].real), roots[~real & (roots.imag > 0)]
