"""Where the poles and zeros of a fit lie, each in the ellipse that its scatter leaves it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf.shared.arguments import of_kind, probability
from nlfrf.shared.axes import axes, finished
from robust.modelling.nominal import NominalFit
from robust.plot.colours import COLOR, hz

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["ellipse", "plot_roots"]


ROUND = np.linspace(0, 2 * np.pi, 121)
KINDS = (("poles", "x", "limit", "-"), ("zeros", "o", "loop", "--"))


def plot_roots(fit: NominalFit, *, confidence: float = 0.95, ax: Axes | None = None) -> Axes:
    """Poles and zeros of a fit with their confidence ellipses, real ones with an interval.

    Parameters
    ----------
    fit : NominalFit
        From `fit_nominal`, of one input and one output, with the standard deviation of its lines.
    confidence : float
        Probability that an ellipse holds the root, each by itself.
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given. In Hz, roots over 2 pi, or in the plane of z.

    Raises
    ------
    ValueError
        A confidence that is no probability; a fit without standard deviations.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 9.11 (covariance of the sample maximum likelihood estimate), 19.1.4 (ellipses).
    """
    of_kind("fit", fit, NominalFit)
    p, known = probability("confidence", confidence), fit.uncertainty
    if known is None:
        raise ValueError("fit must know how its poles scatter (fit.uncertainty), got None")
    ax, sampled = axes(ax), bool(fit.G.dt)
    for name, marker, colour, line in KINDS:
        roots, covariances = getattr(known, name), getattr(known, f"cov_{name}")
        shown = roots if sampled else hz(roots)
        ax.plot(shown.real, shown.imag, marker, ms=4, mfc="none", color=COLOR[colour], label=name)
        for i, (root, covariance) in enumerate(zip(roots, covariances, strict=True)):
            curve = ellipse(root, covariance, p) if sampled else hz(ellipse(root, covariance, p))
            label = f"{100 * p:g} % of each of the {name}" if i == 0 else None
            ax.plot(curve.real, curve.imag, line, lw=1.1, color=COLOR[colour], label=label)
    ax.margins(0.2)
    ax.autoscale_view()
    ax.set_autoscale_on(False)  # around the roots: the whole of the circle would hide their ellipses
    if sampled:
        ax.plot(np.cos(ROUND), np.sin(ROUND), ":", lw=0.9, color="0.4", label="unit circle")
    else:
        ax.axvline(0, ls=":", lw=0.9, color="0.4", label="limit of stability")
    unit = "z" if sampled else "s / 2π [Hz]"
    ax.set(xlabel=f"real part of {unit}", ylabel=f"imaginary part of {unit}", title="Poles and zeros of the fit")
    return finished(ax)


def ellipse(root: complex, covariance: np.ndarray, p: float) -> np.ndarray:
    """(K,) points around a normal root of this covariance (2, 2) of its parts that holds it with probability p.

    A complex root lies within where x' C^-1 x < -2 ln(1 - p), a real one within the interval of one normal variable.

    >>> bool(np.isclose(np.abs(ellipse(0, np.eye(2), 0.95)).max(), 2.4477, atol=1e-4))
    True
    """
    values, axes_of = np.linalg.eigh(covariance)
    flat = values[0] <= 1e-12 * values[1]  # a real root
    size = np.sqrt(2) * erfinv(p) if flat else np.sqrt(-2 * np.log1p(-p))
    radii = size * np.sqrt(np.maximum(values, 0.0))
    x, y = (axes_of * radii) @ np.array([np.cos(ROUND), np.sin(ROUND)])
    return np.asarray(root + x + 1j * y)


def erfinv(p: float) -> float:
    """Where erf is p."""
    from scipy.special import erfinv as inverse

    return float(inverse(p))
