"""Disk margins: allowed change of gain, of phase, or of both, in all channels at once.

For several channels, the margin of one channel with the others unchanged can mislead: the margin
for all channels at once can be a hundredth of it. Inputs and outputs of the plant are the channels
of one loop,

    u = -K y      L = [ 0  K]      (1 + L)^-1 = [ S_I   -K S ]
    y =  G u          [-G  0]                   [ G S_I   S  ]

whose diagonal blocks belong to the inputs and to the outputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from typing import TypeAlias

import control
import numpy as np
from scipy.linalg import matrix_balance

from nlfrf._base.arguments import require_integer, require_real, short_form
from nlfrf._base.values import value
from robust._base.types import AnySystem, Controller
from robust.lti.connections import block_diagonal, lower_lft, require_shape
from robust.lti.grids import lines_with_modes, structure_grid
from robust.lti.low_frequency import read_below
from robust.lti.lti import (
    common_sampling_time,
    is_constant,
    require_sampling_time,
    response_by_channel,
    sampling_times_differ,
    signal_names,
    timebase,
)
from robust.lti.realisation import multivariable
from robust.lti.stability import winding_number
from robust.models.sets.model import UncertaintyModel
from robust.mu.scalings import refine_grid, upper
from robust.pages.text import format_table
from robust.proofs.search.stability import decide_stability


@value
class DiskMargin:
    """Disk margin: the largest disk of complex factors around one for which a loop stays stable.

    Fields
    ------
    alpha : float
        Size of the disk; nan if the loop is not stable, with the cause in `reason`.
    omega : float
        Frequency at which the margin is smallest [rad/s].
    skew : float
        Shape of the disk. 0: the same range for an increase and a decrease of the gain. 1: alpha is
        the distance of L from -1, which is 1/max |S|. -1: alpha is 1/max |T|.
    gain_margin : tuple of float
        Smallest and largest gain by which each channel may be multiplied.
    phase_margin : float
        Largest phase [rad] by which each channel may be shifted; inf if any phase is allowed.
    reason : str
        Reason why there is no margin; else empty.
    channels : tuple of int
        Channels that change, counted from 0, while the other channels stay closed; empty for all
        channels.

    References
    ----------
    Seiler, Packard & Gahinet, *An Introduction to Disk Margins*, IEEE Control Systems Magazine
    40(5), 2020.

    Examples
    --------
    >>> disk_margin(control.tf([250], [1, 10, 10, 10])).reason
    'the loop is unstable: a pole at 0.5922+4.785j'
    """

    alpha: float
    omega: float
    skew: float
    gain_margin: tuple[float, float]
    phase_margin: float
    reason: str
    channels: tuple[int, ...] = ()

    def __str__(self) -> str:
        """One line."""
        if self.reason:
            return f"no disk margin: {self.reason}"
        some = ", ".join(str(k + 1) for k in self.channels)
        if len(self.channels) == 1:
            where = f"channel {some} alone"
        else:
            where = f"channels {some} at once"
        return (
            f"disk margin {self.alpha:.4g} at {self.omega / 2 / np.pi:.4g} Hz:"
            f" {_format_margins(self)}, in {where if some else 'all channels at once'}"
        )


@value
class LoopMargins:
    """Disk margins of a loop with several channels, for one channel at a time and for all at once.

    Fields
    ------
    inputs, outputs : tuple of DiskMargin
        Margin of each single input and output of the plant; the other channels stay closed.
    all_inputs, all_outputs : DiskMargin
        Margin if all inputs change at once, and if all outputs change at once.
    everywhere : DiskMargin
        Margin if all inputs and outputs change at once.
    input_names, output_names : tuple of str
        Names of the channels.

    References
    ----------
    Seiler, Packard & Gahinet, *An Introduction to Disk Margins*, IEEE Control Systems Magazine
    40(5), 2020.

    Examples
    --------
    >>> lags = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> margins = disk_margins(lags, 2 * np.eye(2), skew=-1)                     # 1/max |T| = 3/2, both alike
    >>> round(margins.inputs[0].alpha, 4), round(margins.all_inputs.alpha, 4)
    (1.5, 1.5)
    """

    inputs: tuple[DiskMargin, ...]
    outputs: tuple[DiskMargin, ...]
    all_inputs: DiskMargin
    all_outputs: DiskMargin
    everywhere: DiskMargin
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]

    @property
    def reason(self) -> str:
        """Reason why there are no margins; else empty."""
        return self.everywhere.reason

    def least(self) -> str:
        """Describe the smallest margin of a channel, and those of all inputs, all outputs, and
        both.
        """
        alone = (*self.inputs, *self.outputs)
        k = int(np.argmin([margin.alpha for margin in alone]))
        name = (*self.input_names, *self.output_names)[k]
        return (
            f"one loop at a time {_format_margins(alone[k])} ({name}); all inputs at once "
            f"{_format_margins(self.all_inputs)}; all outputs "
            f"{_format_margins(self.all_outputs)}; all of them {_format_margins(self.everywhere)}"
        )

    def __str__(self) -> str:
        """One row for each margin."""
        if self.reason:
            return f"no disk margins: {self.reason}"
        named = zip(
            (*self.input_names, *self.output_names), (*self.inputs, *self.outputs), strict=True
        )
        rows = [(f"{name} alone", margin) for name, margin in named]
        rows += [
            ("all inputs", self.all_inputs),
            ("all outputs", self.all_outputs),
            ("all of them", self.everywhere),
        ]
        return format_table(
            [
                (name, f"disk margin {margin.alpha:.4g}: {_format_margins(margin)}")
                for name, margin in rows
            ]
        )


def _decibels(gain: float) -> float:
    """Return 20 log10 of a gain; -inf for zero."""
    if gain > 0:
        return float(20 * np.log10(gain))
    return -np.inf


def _format_margins(margin: DiskMargin) -> str:
    """Format the gains [dB] and the phase [deg] of a margin; "any positive gain" if only rounding
    bounds the gain.

    >>> _format_margins(disk_margin(control.ss(-1.0, 1.0, 0.1, 0.0)))
    'any positive gain, phase 90.0 deg'
    """
    low, high = margin.gain_margin
    free = low < 1e-9 and high > 1e9
    if free:
        gains = "any positive gain"
    else:
        gains = f"gain {_decibels(low):.2f} to {_decibels(high):+.2f} dB"
    return f"{gains}, phase {np.degrees(margin.phase_margin):.1f} deg"


def disk_margin(
    L: AnySystem, *, skew: float = 0.0, n_unstable: int = 0, channels: Sequence[int] | None = None
) -> DiskMargin:
    """Compute the disk margin of a loop L with unit negative feedback.

    Use this instead of gain and phase margin, because it covers changes of gain and phase at the
    same time. `disk_margins` computes it for each input and output of a plant.

    Parameters
    ----------
    L : control.StateSpace, TransferFunction or FrequencyResponseData
        Loop gain, broken at the plant input (K G) or output (G K), with as many inputs as outputs.
        For an FRF the margin holds on its lines only, and stability is decided from the winding
        number of det(I + L) around zero.
    skew : float
        Shape of the disk, see `DiskMargin`.
    n_unstable : int
        Number of unstable poles of L, for an FRF.
    channels : sequence of int, optional
        Channels that change, counted from 0, while the other channels stay closed. Default: all.

    Returns
    -------
    DiskMargin
        alpha is 1/max mu(S + (skew - 1)/2 I) over frequency, with one complex block for each
        channel. On the frequency grid alpha is never larger than the true margin, and equal to it
        for up to three channels.

    Raises
    ------
    ValueError
        An L that is not square, a channel that does not exist, an algebraic loop without a solution
        (I + D singular), or an FRF that is not finite.

    References
    ----------
    Seiler, Packard & Gahinet, *An Introduction to Disk Margins*, IEEE Control Systems Magazine
    40(5), 2020.

    Examples
    --------
    Seiler, Packard & Gahinet, the loop of their first example.

    >>> margin = disk_margin(control.tf([25], [1, 10, 10, 10]))
    >>> print(margin)
    disk margin 0.4581 at 0.3112 Hz: gain -4.05 to +4.05 dB, phase 25.8 deg, in all channels at once
    """
    skew = require_real("skew", skew)
    n_unstable = require_integer("n_unstable", n_unstable, least=0)
    S, reason = _sensitivity_if_stable(L, n_unstable)
    return _margin_of_sensitivity(
        S,
        reason,
        skew=skew,
        channels=None if channels is None else _checked_channels(S.ninputs, channels),
    )


def disk_margins(
    G: AnySystem | UncertaintyModel, K: Controller, *, skew: float = 0.0, n_unstable: int = 0
) -> LoopMargins:
    """Compute the disk margins of the loop u = K (r - y) at the plant inputs and outputs.

    Use this for a loop with several channels. It gives the margin of each channel alone, and the
    margin of all channels at once, which may be small although each channel alone has a large
    margin.

    Parameters
    ----------
    G : control.StateSpace, TransferFunction, FrequencyResponseData or UncertaintyModel
        Plant with one or several inputs and outputs. The margins of an UncertaintyModel are those
        of its nominal. For an FRF the margins hold on its lines only.
    K : control.StateSpace, TransferFunction, float or (n_u, n_y) ndarray
        Controller, negative feedback, on the same time base.
    skew : float
        Shape of the disk, see `DiskMargin`.
    n_unstable : int
        Number of unstable poles of G and K together, for an FRF.

    Returns
    -------
    LoopMargins
        An unstable loop is a result, not an error: `reason` states the cause.

    Raises
    ------
    ValueError
        A K that does not fit G, sampling times that differ, an algebraic loop without a solution,
        or an FRF that is not finite.

    References
    ----------
    Seiler, Packard & Gahinet, *An Introduction to Disk Margins*, IEEE Control Systems Magazine
    40(5), 2020.

    Examples
    --------
    A spinning body: each loop alone allows any gain, but both gains at once may change by a tenth
    only.

    >>> G = control.ss([[0, 10], [-10, 0]], np.eye(2), [[1, 10], [-10, 1]], np.zeros((2, 2)))
    >>> margins = disk_margins(G, np.eye(2))
    >>> round(margins.inputs[0].alpha, 2), round(margins.all_inputs.alpha, 4)    # 1/sqrt(100.5)
    (2.0, 0.0998)
    """
    G, names = _plant_and_names(G)
    K = multivariable("K", K)
    n_y, n_u = G.noutputs, G.ninputs
    require_shape(K, n_y, n_u)
    S, reason = _sensitivity_if_stable(
        _loop_broken_everywhere(G, K), require_integer("n_unstable", n_unstable, least=0)
    )
    skew = require_real("skew", skew)

    def of(*channels: int) -> DiskMargin:
        return _margin_of_sensitivity(S, reason, skew=skew, channels=channels)

    into, out = range(n_u), range(n_u, n_u + n_y)
    return LoopMargins(
        inputs=tuple(of(k) for k in into),
        outputs=tuple(of(k) for k in out),
        all_inputs=of(*into),
        all_outputs=of(*out),
        everywhere=of(*into, *out),
        input_names=names[0],
        output_names=names[1],
    )


_Names: TypeAlias = "tuple[tuple[str, ...], tuple[str, ...]]"


@singledispatch
def _plant_and_names(
    G: AnySystem,
) -> tuple[control.StateSpace | control.FrequencyResponseData, _Names]:
    """Return a plant as a system or an FRF, and the names of its inputs and outputs."""
    plant = multivariable("G", G)
    return plant, signal_names(plant)


@_plant_and_names.register(control.FrequencyResponseData)
def _frf_and_names(
    G: control.FrequencyResponseData,
) -> tuple[control.FrequencyResponseData, _Names]:
    return G, signal_names(G)


@_plant_and_names.register(UncertaintyModel)
def _nominal_and_names(
    G: UncertaintyModel,
) -> tuple[control.StateSpace | control.FrequencyResponseData, _Names]:
    return G.nominal, (G.inputs, G.outputs)


@singledispatch
def _loop_broken_everywhere(
    G: control.StateSpace, K: control.StateSpace
) -> control.StateSpace | control.FrequencyResponseData:
    """Return [0 K; -G 0], the loop broken at all inputs and outputs of the plant; an FRF of an
    FRF.
    """
    n_y, n_u = G.noutputs, G.ninputs
    if sampling_times_differ(G, K):
        raise ValueError(
            f"K must have the sampling time of G, {timebase(G):g} s, got {timebase(K):g} s"
        )
    P = block_diagonal(
        [K, G], timebase(K) if is_constant(G) else timebase(G)
    )  # from (y, u) to (K y, G u)
    turned, signs = np.r_[n_y : n_y + n_u, :n_y], np.r_[np.ones(n_u), -np.ones(n_y)][:, None]
    return control.StateSpace(P.A, P.B[:, turned], signs * P.C, signs * P.D[:, turned], P.dt)


@_loop_broken_everywhere.register(control.FrequencyResponseData)
def _frf_broken_everywhere(
    G: control.FrequencyResponseData, K: control.StateSpace
) -> control.FrequencyResponseData:
    n_y, n_u = G.noutputs, G.ninputs
    omega = np.asarray(G.omega, dtype=float)
    require_sampling_time("K", K, reference="G", wanted=common_sampling_time(G))
    dt = timebase(K)
    if dt and omega[-1] * dt > np.pi * (1 + 1e-9):
        raise ValueError(
            "K must have its Nyquist frequency above the lines of G, got a sampling time of"
            f" {dt:g} s"
        )
    omega, plant = lines_with_modes(omega, np.asarray(G.frdata), K)
    L = np.zeros((n_u + n_y, n_u + n_y, omega.size), dtype=complex)
    L[:n_u, n_u:], L[n_u:, :n_u] = response_by_channel(K, omega), -plant
    return control.FrequencyResponseData(L, omega)


def _checked_channels(n: int, channels: Sequence[int]) -> tuple[int, ...]:
    """Return the channels, each checked to be one of n and given once."""
    if not isinstance(channels, Sequence):
        raise ValueError(
            f"channels must be some of 0 to {n - 1}, each once, got {short_form(channels)}"
        )
    some = tuple(require_integer("channels", k, least=0) for k in channels)
    if not some or max(some) >= n or len(set(some)) < len(some):
        raise ValueError(f"channels must be some of 0 to {n - 1}, each once, got {list(channels)}")
    return some


def _margin_of_sensitivity(
    S: control.StateSpace | control.FrequencyResponseData,
    reason: str,
    *,
    skew: float,
    channels: Sequence[int] | None,
) -> DiskMargin:
    """Compute the margin of some channels of a sensitivity; nan with `reason` if there is none."""
    if reason:
        return DiskMargin(
            alpha=np.nan,
            omega=np.nan,
            skew=skew,
            gain_margin=(np.nan, np.nan),
            phase_margin=np.nan,
            reason=reason,
        )
    some = range(S.ninputs) if channels is None else channels
    omega, alpha = _smallest_margin(S, np.ix_(some, some), skew)
    if np.isinf(
        alpha
        # a loop that is a number allows every gain except one; a loop that is zero allows every gain
    ):
        if skew != -1:
            edge = (skew - 1) / (skew + 1)
        else:
            edge = -np.inf
        if np.isfinite(edge):
            low, up, high = edge, edge, -np.inf
        else:
            low, up, high = edge, np.inf, np.inf
    else:
        low, high = (2 - (1 - skew) * alpha) / (2 + (1 + skew) * alpha), 2 - (1 + skew) * alpha
        if high:
            up = (2 + (1 - skew) * alpha) / high
        else:
            up = np.inf
    # the disk meets the unit circle at the phase where its rim does; the rim passes through the two
    # gains
    if np.isfinite(up):
        cosine = (1 + low * up) / (low + up)
    else:
        cosine = low
    return DiskMargin(
        alpha=alpha,
        omega=omega,
        skew=skew,
        gain_margin=(low, up if high > 0 else np.inf),
        phase_margin=float(np.arccos(cosine)) if abs(cosine) <= 1 else np.inf,
        reason="",
        channels=() if len(some) == S.ninputs else tuple(some),
    )


@singledispatch
def _smallest_margin(
    S: control.StateSpace, block: tuple[np.ndarray, ...], skew: float
) -> tuple[float, float]:
    """Return frequency and value of the smallest margin of a block of the sensitivity, a system or
    an FRF.
    """
    shift, blocks = _shift_and_blocks(block, skew)
    some = block[1][0]
    M = control.StateSpace(S.A, S.B[:, some], S.C[some], S.D[block] + shift, S.dt)
    return _margin_of_mu(*refine_grid(M, blocks, omega=structure_grid(M)))


@_smallest_margin.register(control.FrequencyResponseData)
def _smallest_margin_on_lines(
    S: control.FrequencyResponseData, block: tuple[np.ndarray, ...], skew: float
) -> tuple[float, float]:
    shift, blocks = _shift_and_blocks(block, skew)
    mu = upper(np.asarray(S.frdata)[block] + shift[:, :, None], blocks).value
    return _margin_of_mu(np.asarray(S.omega), mu)


def _shift_and_blocks(
    block: tuple[np.ndarray, ...], skew: float
) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Return what is added to the sensitivity, and a number for each of its channels."""
    n = block[0].size
    return (skew - 1) / 2 * np.eye(n), [(1, 1)] * n


def _margin_of_mu(omega: np.ndarray, mu: np.ndarray) -> tuple[float, float]:
    k = int(mu.argmax())
    return float(omega[k]), float(1 / mu[k]) if mu[k] > 0 else np.inf


@singledispatch
def _sensitivity_if_stable(
    L: AnySystem, n_unstable: int
) -> tuple[control.StateSpace | control.FrequencyResponseData, str]:
    """Return (1 + L)^-1, scaled by `_balancing_scales`, and the reason why there is no margin,
    empty if stable; of a system, or of an FRF as an FRF.
    """
    del n_unstable  # a system shows its own
    L = multivariable("L", L)
    _require_square_loop(L.noutputs, L.ninputs)
    one = np.eye(L.ninputs)
    unit = _balancing_scales(response_by_channel(L, structure_grid(L)[1:]))
    B, C, D = L.B * unit, L.C / unit[:, None], L.D * unit / unit[:, None]
    # e = r - L e, closed through one
    P = control.StateSpace(
        L.A, np.hstack([0 * B, B]), np.vstack([-C] * 2), np.block([[one, -D]] * 2), L.dt
    )
    S = lower_lft(P, control.StateSpace([], [], [], one, L.dt))
    nominal = decide_stability(S)
    return S, "" if nominal.stable else f"the loop is {nominal}"


@_sensitivity_if_stable.register(control.FrequencyResponseData)
def _sensitivity_on_lines(
    L: control.FrequencyResponseData, n_unstable: int
) -> tuple[control.FrequencyResponseData, str]:
    _require_square_loop(L.noutputs, L.ninputs)
    omega, response = np.asarray(L.omega, dtype=float), np.moveaxis(np.asarray(L.frdata), 2, 0)
    if not np.isfinite(response).all():
        raise ValueError("L must have a finite FRF on every line, got nan or infinite numbers")
    unit = _balancing_scales(np.asarray(L.frdata))
    difference = np.eye(L.ninputs) + response * unit / unit[:, None]
    turns, clear = winding_of_matrix(omega, difference, n_unstable)
    S = control.FrequencyResponseData(np.moveaxis(np.linalg.inv(difference), 0, 2), omega)
    if not clear:
        return (
            S,
            (
                "the lines do not show whether the loop is stable: they are too far apart, or do"
                " not reach far enough"
            ),
        )
    if turns != n_unstable:
        return (
            S,
            f"unstable: det(I + L) winds {turns} times about zero, stability needs {n_unstable}",
        )
    return S, ""


def winding_of_matrix(
    omega: np.ndarray, difference: np.ndarray, n_unstable: int
) -> tuple[int, bool]:
    """Return the winding number of det(I + L) around zero, from I + L (W, n, n), and whether the
    lines resolve it.

    n_unstable : unstable poles of the open loop, which determine the phase below the first line.
    """
    static, whole = control.StateSpace([], [], [], 1.0, 0), np.linalg.det(difference) - 1
    readings = read_below(omega, whole, n_unstable=n_unstable)
    return winding_number(omega, whole, K=static, dt=0.0, readings=readings)


def _balancing_scales(L: np.ndarray) -> np.ndarray:
    """Return powers of two (n,) that scale the channels of a loop (n, n, W) to comparable size.

    Margins do not depend on units, but a matrix with 1e6 N/m and 1e-6 m/N would look singular. If a
    channel is not reached at all, the smallest gain of the loop replaces its zero gain.
    """
    with np.errstate(invalid="ignore"):
        size = np.abs(np.where(np.isfinite(L), L, np.nan))
        size = np.nan_to_num(
            np.exp(np.nanmean(np.log(np.maximum(size, np.finfo(float).tiny)), axis=2))
        )
    some = size[size > 1e-200]
    if not some.size:
        return np.ones(len(size))
    return np.asarray(
        matrix_balance(np.maximum(size, some.min()), permute=False, separate=True)[1][0]
    )


def _require_square_loop(n_out: int, n_in: int) -> None:
    if n_out != n_in:
        raise ValueError(
            f"L must have as many inputs as outputs, got {n_in} inputs and {n_out} outputs"
        )
