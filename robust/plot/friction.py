"""Pictures of what friction does to a loop, amplitude by amplitude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import require_kind
from nlfrf._base.axes import AxesLike, axes_or_new, bode_axes, finish_axes
from robust.friction.describing_function import QuasiLinear
from robust.friction.identification import FrictionFit
from robust.plot.style import COLOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Below this part of the largest friction the axes run straight through zero, above it they are logarithmic.
LINEAR_SHARE = 1e-2


def plot_quasi_linear(prediction: QuasiLinear, *, kick_sure: float = np.nan, ax: Axes | None = None) -> Axes:
    """k_eq + j w c_eq of the friction, from sticking to sliding, against -1/P, where the loop would swing for ever.

    Amplitudes from which the motion grows are drawn in the colour of a limit; some are marked with their amplitude and
    velocity. Both axes are straight around zero and logarithmic beyond.

    Parameters
    ----------
    prediction : QuasiLinear
    kick_sure : float
        The proved kick of a sure run-away [m/s], `FrictionProof.kick_sure`, told beside the predicted one.
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.
    """
    require_kind("prediction", prediction, QuasiLinear)
    ax = axes_or_new(ax)
    q = prediction
    N = (q.stiffnesses + 1j * q.frequencies * q.dampings) / 1e3
    grows = q.growths > 0
    top = np.abs(N).max()
    near = np.abs(q.boundary) < 3e3 * top
    ax.plot(*complex_parts(q.boundary / 1e3, near), color=COLOR["radius"], lw=1.4, label="-1/P of the loop")
    for chosen, color, words in (
        (~grows, COLOR["loop"], "friction: the motion falls"),
        (grows, COLOR["limit"], "friction: the motion grows"),
    ):
        if chosen.any():
            ax.plot(*complex_parts(N, chosen), "-", color=color, lw=2.2, label=words)
    for a in 10.0 ** np.arange(np.ceil(np.log10(q.amplitudes[0])), np.log10(q.amplitudes[-1]) + 0.01):
        i = int(np.argmin(np.abs(np.log(q.amplitudes / a))))
        if 0.1 * LINEAR_SHARE * top < np.abs(N[i]) and (i == 0 or np.abs(np.log(np.abs(N[i] / N[0]))) > 0.02):
            ax.plot(N[i].real, N[i].imag, ".", color="0.25")
            ax.annotate(
                f"{format_amplitude(a)}, {q.frequencies[i] * a:.2g} m/s",
                (N[i].real, N[i].imag),
                xytext=(7, -7),
                textcoords="offset points",
                fontsize="x-small",
            )
    ax.set_xscale("symlog", linthresh=LINEAR_SHARE * top)
    ax.set_yscale("symlog", linthresh=LINEAR_SHARE * top)
    ax.set(xlim=(-3 * top, 12 * top), ylim=(-3 * top, 3 * top))
    ax.set(xlabel="k_eq [kN/m]", ylabel="w c_eq [kN/m]", title=quasi_linear_title(q, kick_sure))
    return finish_axes(ax)


def plot_friction_fit(fit: FrictionFit, *, ax: AxesLike | None = None) -> tuple[Axes, Axes]:
    """k_eq and c_eq of the friction over the rms of the motion: measured at every level, and of the fitted elements.

    Where the two part, another friction or another machine was measured.

    Parameters
    ----------
    fit : FrictionFit
        Of `robust.friction.identify_friction`.
    ax : two matplotlib Axes, or one in the place of which both are drawn, optional
        Where to draw; a new figure when not given.
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
        axes.plot(amplitude, fitted, "-", color=COLOR["loop"], label=f"{fit.element_stiffness.size} Maxwell elements")
        axes.set(xscale="log", ylabel=label)
    top.axhline(fit.K0, color=COLOR["radius"], lw=1.0, label="K0")
    top.set_title(f"Friction over the motion: K0 {fit.K0:.4g} {force}/{length}, Fs {fit.Fs:.4g} {force}")
    bottom.set_xlabel(f"rms of the motion [µ{length}]")
    finish_axes(bottom)
    return finish_axes(top), bottom


def complex_parts(z: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return real and imaginary parts of those that are chosen; nan in between."""
    return np.where(chosen, z.real, np.nan), np.where(chosen, z.imag, np.nan)


def format_amplitude(a: float) -> str:
    """Return an amplitude in its usual unit."""
    for unit, size in (("nm", 1e-9), ("um", 1e-6), ("mm", 1e-3)):
        if a < 999 * size:
            return f"{a / size:.3g} {unit}"
    return f"{a:.3g} m"


def quasi_linear_title(q: QuasiLinear, kick_sure: float) -> str:
    """Return the heading."""
    fates = {0.0: "not to come to rest", np.inf: "to come to rest"}
    text = "Predicted " + fates.get(q.amplitude, f"to grow from a kick of {q.kick:.3g} m/s")
    return f"{text},\nsurely to run away from {kick_sure:.3g} m/s" if np.isfinite(kick_sure) else text
