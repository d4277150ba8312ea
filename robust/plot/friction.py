"""Pictures of friction: its estimate, and the positions at which an axis rests with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from itertools import cycle
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nlfrf._base.arguments import require_kind, short_form
from nlfrf._base.axes import AxesLike, axes_or_new, bode_axes, finish_axes
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust.friction.reading.force import FrictionForce
from robust.friction.reading.friction_fit import FrictionFit
from robust.friction.units import format_length
from robust.plot.style import COLOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colours of levels, in their order.
_LEVEL_COLORS = (COLOR["misfit"], COLOR["loop"], COLOR["level"], COLOR["limit"])
#: Range of a picture of the friction force on either side, in widths of presliding (break-away
#: force over stiffness).
_SLIP_LENGTHS = 4.0


def plot_friction_fit(fit: FrictionFit, *, ax: AxesLike | None = None) -> tuple[Axes, Axes]:
    """Plot equivalent stiffness k_eq and damping c_eq of the friction over the rms of the motion.

    The plot shows the measured values at each level and the values of the fit. If they differ,
    friction or machine are not of the kind that the fit assumes.

    Parameters
    ----------
    fit : FrictionFit
        Fit from `robust.friction.identify_friction`.
    ax : two matplotlib Axes, or one in the place of which both are drawn, optional
        Where to draw; a new figure by default.
    """
    require_kind("fit", fit, FrictionFit)
    top, bottom = bode_axes(ax)
    levels = sorted(fit.levels, key=lambda level: level.motion)
    amplitude = [1e6 * level.motion for level in levels]
    force, length = fit.units
    for axes, name, label in (
        (top, "stiffness", f"k_eq [{force}/{length}]"),
        (bottom, "damping", f"c_eq [{force} s/{length}]"),
    ):
        measured = [getattr(level, name) for level in levels]
        fitted = [getattr(level, f"{name}_fit") for level in levels]
        axes.plot(amplitude, measured, "o", color=COLOR["limit"], label="measured")
        axes.plot(
            amplitude,
            fitted,
            "-",
            color=COLOR["loop"],
            label=f"{fit.element_stiffness.size} Maxwell elements",
        )
        axes.set(xscale="log", ylabel=label)
    top.axhline(fit.K0, color=COLOR["radius"], lw=1.0, label="K0")
    top.set_title(
        f"Friction over the motion: K0 {fit.K0:.4g} {force}/{length}, Fs {fit.Fs:.4g} {force}"
    )
    bottom.set_xlabel(f"rms of the motion [µ{length}]")
    finish_axes(bottom)
    return finish_axes(top), bottom


def plot_friction_force(
    loops: Mapping[str, np.ndarray],
    read: FrictionFit | FrictionForce,
    *,
    ax: AxesLike | None = None,
) -> Axes:
    """Draw the friction force over the position of each record at rest, with the estimated
    friction.

    While the friction sticks, the force follows a line with the presliding stiffness K0. While it
    slides, the force stays within the break-away force. For an estimate with friction elements the
    virgin curve is drawn, which is the force during a first push from rest. Numbers that the levels
    do not determine are not drawn.

    Parameters
    ----------
    loops : mapping of str to (2, n) ndarray
        Position [m] and friction force [N] over a period, by the name of the record.
    read : FrictionFit or FrictionForce
        Estimate from the records.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    require_kind("read", read, FrictionFit, FrictionForce)
    if not isinstance(loops, Mapping) or not loops:
        raise ValueError(
            f"loops must hold position and force of a record by its name, got {short_form(loops)}"
        )
    ax = axes_or_new(ax)
    drawn = _drawn_force(read)
    force, length = drawn.units
    for k, ((name, (x, f)), color) in enumerate(
        zip(loops.items(), cycle(_LEVEL_COLORS))
    ):  # the smallest on top
        ax.plot(
            1e6 * np.append(x, x[0]),
            np.append(f, f[0]),
            "-",
            lw=0.8,
            color=color,
            label=name,
            zorder=3 - 0.1 * k,
        )
    K0, Fs = drawn.K0, drawn.Fs
    widest = max(float(np.ptp(x)) for x, _ in loops.values())
    if K0 * Fs > 0 and np.isfinite(K0 * Fs):
        reach = min(widest, _SLIP_LENGTHS * Fs / K0)
    else:
        reach = widest
    if drawn.element_stiffness.size and np.isfinite(K0 * Fs):
        x = np.linspace(-reach, reach, 401)
        virgin = np.sign(x) * np.minimum(
            np.outer(np.abs(x), drawn.element_stiffness), drawn.element_strength
        ).sum(axis=1)
        label = f"virgin curve, {drawn.element_stiffness.size} Maxwell elements"
        ax.plot(1e6 * x, virgin, "-", lw=2.0, color=COLOR["radius"], label=label, zorder=4)
    if np.isfinite(Fs):
        ax.axhline(
            Fs,
            ls="--",
            lw=1.0,
            color=COLOR["weight"],
            label=f"break-away force {drawn.at_most}{Fs:.4g} {force}",
        )
        ax.axhline(-Fs, ls="--", lw=1.0, color=COLOR["weight"])
    if np.isfinite(K0 * Fs) and K0 > 0:
        end = 1e6 * Fs / K0
        label = f"presliding stiffness {K0 / 1e3:.4g} k{force}/{length}"
        ax.plot([-end, end], [-Fs, Fs], ":", lw=1.4, color=COLOR["weight"], label=label)
    ax.set(
        xlim=(-1e6 * reach, 1e6 * reach),
        xlabel=f"position from its mean [µ{length}]",
        ylabel=f"friction force [{force}]",
        title="Friction over position, at rest",
    )
    return finish_axes(ax)


@value(copy=False)
class _DrawnForce:
    """What a picture shows of an estimate of friction; a number is nan if undetermined."""

    units: tuple[str, str]  # of force and length
    K0: float  # presliding stiffness [N/m]
    Fs: float  # break-away force [N]
    at_most: str = ""  # before a break-away force that is an upper bound
    element_stiffness: np.ndarray = field(default_factory=lambda: np.zeros(0))
    element_strength: np.ndarray = field(default_factory=lambda: np.zeros(0))


def _drawn_force(read: FrictionFit | FrictionForce) -> _DrawnForce:
    if isinstance(read, FrictionForce):
        return _DrawnForce(
            units=read.sliding.units,
            K0=float(np.mean(read.K0)),
            Fs=float(read.Fs.max()),
            at_most="at most ",
        )
    K0, Fs = (
        number if np.isfinite(read.stds[name]) else np.nan
        for name, number in (("K0", read.K0), ("Fs", read.Fs))
    )
    return _DrawnForce(
        units=read.units,
        K0=K0,
        Fs=Fs,
        element_stiffness=read.element_stiffness,
        element_strength=read.element_strength,
    )


class RestCase(NamedTuple):
    """An assumption or change, the verdict with it, and the largest distance from the set point,
    infinite if none is known.

    A simulation has no verdict.
    """

    name: str
    verdict: FrictionVerdict | None
    distance: float


def plot_rest(
    cases: Sequence[RestCase],
    *,
    unit: str = "m",
    asked: float | None = None,
    ax: AxesLike | None = None,
) -> Axes:
    """Draw bounds on the final distance of an axis from its set point, one bar for each case.

    Parameters
    ----------
    cases : sequence of RestCase
        For each case its name (an assumption or a change of the drive), the verdict, and the
        largest distance from the set point [m].
    unit : str
        Unit of the distance.
    asked : float, optional
        Distance within which the axis has to stay [m].
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    if not isinstance(cases, list | tuple) or not cases:
        raise ValueError(f"cases must be a list of at least one RestCase, got {short_form(cases)}")
    for case in cases:
        require_kind("cases", case, RestCase)
    ax = axes_or_new(ax)
    distances = np.array([1e6 * distance for *_, distance in cases])
    known = np.append(distances, [] if asked is None else 1e6 * asked)
    known = known[np.isfinite(known) & (known > 0)]
    if known.size:
        low, high = known.min() / 10, known.max() * 30
    else:
        low, high = 0.1, 10.0
    words = {
        "weight": "proved: comes to rest",
        "limit": "may move for ever",
        "noise": "simulated, no proof",
    }
    for row, ((name, verdict, distance), size) in enumerate(zip(cases, distances, strict=True)):
        kind = "weight" if verdict is FrictionVerdict.PROVED else "limit"
        if verdict is None:
            kind = "noise"
        if np.isfinite(size):
            end = max(size, low)
        else:
            end = high
        ax.barh(
            row, end - low, 0.4, left=low, color=COLOR[kind], alpha=0.6, label=words.pop(kind, None)
        )
        if not size:
            ax.plot(low, row, "o", ms=9, color=COLOR[kind], clip_on=False)
        if not np.isfinite(size):
            where = "no bound known"
        else:
            where = format_length(distance, unit)
        texts = {(row, end if np.isfinite(size) else low): where if size else "at the set point"}
        for (height, left), text in ({(row - 0.36, low): name} | texts).items():
            ax.annotate(
                text,
                (left, height),
                xytext=(9, 0),
                textcoords="offset points",
                va="center",
                fontsize="small",
            )
    if asked is not None:
        ax.axvline(
            1e6 * asked,
            color="black",
            ls="--",
            lw=1.0,
            label=f"asked: {format_length(asked, unit)}",
        )
    ax.set_yticks([])
    ax.set_ylim(-0.7, len(cases) - 0.5)
    ax.invert_yaxis()
    ax.set(
        xscale="log",
        xlim=(low, high),
        xlabel=f"largest final distance from the set point [µ{unit}]",
    )
    ax.set_title("Final distance from the set point")
    return finish_axes(ax)
