"""Standard deviations of poles, zeros, gain and delay of a fit, from the Jacobian of its sample ML
cost.

At the minimum of V = sum |G_k - model_k|^2 / var_k the parameters have the covariance c (J^T J)^-1
/ 2. J is the Jacobian of the weighted residual, with the real parts above the imaginary parts. c is
the cost divided by its expectation for known variances; it is one for a correct model with known
variances. The formula holds for small deviations, and does not include the model error.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.values import value
from robust.models.fit.rational import partial_fractions, stack_real_imaginary

#: Cap of the standard deviation over the root of the cost; its square is still a number.
_HUGE = 1e150
_MAX_STATIC_STD = 0.5  # relative standard deviation above which the static gain is not printed


@value(copy=False)
class FitUncertainty:
    """Poles, zeros, gain and delay of a fit with their standard deviations.

    Fields
    ------
    poles, zeros : (n,) complex ndarray
        In the s plane [rad/s] for a continuous model, in the z plane for a discrete one.
    cov_poles, cov_zeros : (n, 2, 2) ndarray
        Covariance of the real and the imaginary part of each root; for a real root the imaginary
        part has no variance.
    static_gain, std_static_gain : float
        Gain at zero frequency [unit of G], infinite for a pole at zero, and its relative standard
        deviation.
    std_delay : float
        Standard deviation of the delay [s]; nan if it was not estimated.
    separation : (n,) ndarray
        Distance of each pole to the nearest zero over the standard deviation of that distance. At
        about one, pole and zero cancel within the scatter. Infinite if no zero is nearer than half
        the size of the pole.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 9.11 (covariance of the sample maximum likelihood estimate).

    Examples
    --------
    >>> import control
    >>> import robust
    >>> omega = np.linspace(1, 20, 40)
    >>> G = 1 / (1j * omega + 3) + 1e-3 * np.random.default_rng(0).standard_normal(40)
    >>> measured = control.FrequencyResponseData(G, omega)
    >>> fit = robust.fit_nominal(measured, n_poles=1, n_zeros=0, std=np.full(40, 1.4e-3))
    >>> bool(abs(fit.uncertainty.poles[0] + 3) < 3 * fit.uncertainty.std_poles[0])
    True
    """

    poles: np.ndarray
    zeros: np.ndarray
    cov_poles: np.ndarray
    cov_zeros: np.ndarray
    static_gain: float
    std_static_gain: float
    std_delay: float
    separation: np.ndarray

    @property
    def std_poles(self) -> np.ndarray:
        """Return (n,) root mean square deviation, the root of E|.|^2, of each pole."""
        return np.sqrt(np.trace(self.cov_poles, axis1=1, axis2=2))

    @property
    def std_zeros(self) -> np.ndarray:
        """Return (n,) root mean square deviation, the root of E|.|^2, of each zero."""
        return np.sqrt(np.trace(self.cov_zeros, axis1=1, axis2=2))


def estimate_uncertainty(
    s: np.ndarray,
    omega: np.ndarray,
    *,
    model: np.ndarray,
    std: np.ndarray,
    zeros: np.ndarray,
    poles: np.ndarray,
    gain: float,
    c: float,
    dt: float,
    free_delay: bool,
) -> FitUncertainty:
    """Estimate the covariance of a fitted model's parameters, as `FitUncertainty`.

    Parameters
    ----------
    s : (F,) complex ndarray
        Points of the fit: j omega, or its bilinear image.
    omega : (F,) ndarray
        Lines [rad/s].
    model : (F,) complex ndarray
        Response of the model at these lines.
    std : (F,) ndarray
        Standard deviation by which each line was weighted.
    zeros, poles : (n,) complex ndarray
        Zeros and poles of the rational function in the s plane, conjugates side by side.
    gain : float
        Leading gain of the rational function.
    c : float
        Cost over the degrees of freedom left.
    dt : float
        Sampling time of the model [s].
    free_delay : bool
        True if a delay was fitted too.
    """
    # columns: derivatives of ln model by ln gain, then by each root
    columns = [np.ones(s.size), -partial_fractions(s, zeros), partial_fractions(s, poles)]
    if free_delay:
        columns.append(-1j * omega)
    J = stack_real_imaginary(np.column_stack(columns) * (model / std)[:, None])
    size = np.maximum(np.linalg.norm(J, axis=0), 1 / _HUGE)  # a root far away has almost no slope
    _, sv, right = np.linalg.svd(J / size, full_matrices=False)
    sv = np.maximum(
        sv, max(1e-14 * sv[0], 1 / _HUGE)
    )  # parameters without influence get a huge standard deviation
    half = np.clip(right.T / sv / size[:, None], -_HUGE, _HUGE)
    cov = c / 2 * half @ half.T
    n_z, at_zero = zeros.size, np.zeros(1, complex)
    with np.errstate(divide="ignore", invalid="ignore"):  # a pole at zero
        static = np.concatenate(
            [[1.0], -partial_fractions(at_zero, zeros)[0], partial_fractions(at_zero, poles)[0]]
        )
        static_gain = float((gain * np.prod(-zeros) / np.prod(-poles)).real)
        std_static_gain = float(np.linalg.norm(static.real @ half[: static.size]) * np.sqrt(c / 2))
    return FitUncertainty(
        poles=_roots_in_model_plane(poles, dt),
        zeros=_roots_in_model_plane(zeros, dt),
        cov_poles=_root_covariances(
            poles, cov[1 + n_z : 1 + n_z + poles.size, 1 + n_z : 1 + n_z + poles.size], dt
        ),
        cov_zeros=_root_covariances(zeros, cov[1 : 1 + n_z, 1 : 1 + n_z], dt),
        static_gain=static_gain,
        std_static_gain=std_static_gain if np.isfinite(std_static_gain) else float("inf"),
        std_delay=float(np.sqrt(cov[-1, -1])) if free_delay else float("nan"),
        separation=_separations(
            zeros, poles, cov[1 : 1 + n_z + poles.size, 1 : 1 + n_z + poles.size]
        ),
    )


def _separations(zeros: np.ndarray, poles: np.ndarray, cov: np.ndarray) -> np.ndarray:
    """Return (n,) the distance of each pole to its nearest zero over the standard deviation of that
    distance.

    cov : covariance of the real and imaginary parts of zeros, then poles, conjugates once (as in
    `partial_fractions`).
    """
    if not zeros.size:
        return np.full(poles.size, np.inf)
    near = np.argmin(np.abs(poles[:, None] - zeros), axis=1)
    difference = np.concatenate([-_root_parts(zeros)[near], _root_parts(poles)], axis=2)
    variance = np.einsum("nij,jk,nik->n", difference, cov, difference)
    distance = np.abs(poles - zeros[near])
    over_std = distance / np.sqrt(np.maximum(variance, np.finfo(float).tiny))
    return np.where(distance < np.abs(poles) / 2, over_std, np.inf)


def _root_parts(roots: np.ndarray) -> np.ndarray:
    """Return (n, 2, n) derivatives of the real and imaginary part of each root by those of real
    roots and pairs.
    """
    rows = np.zeros((roots.size, 2, roots.size))
    for i, root in enumerate(roots):
        if root.imag < 0 and i:  # the conjugate of the one before
            rows[i] = np.array([[1], [-1]]) * rows[i - 1]
            continue
        rows[i, 0, i] = 1.0
        if root.imag:
            rows[i, 1, i + 1] = 1.0
    return rows


def _root_covariances(roots: np.ndarray, cov: np.ndarray, dt: float) -> np.ndarray:
    """Return (n, 2, 2) covariance of real and imaginary part of each root."""
    rows = _root_parts(roots)
    out = rows @ cov @ rows.transpose(0, 2, 1)
    if dt:
        slope = dt / (1 - roots * dt / 2) ** 2  # slope of z = (1 + s dt/2)/(1 - s dt/2)
        turn = np.array([[slope.real, -slope.imag], [slope.imag, slope.real]]).transpose(2, 0, 1)
        turn[roots.imag == 0, 1] = 0.0
        out = turn @ out @ turn.transpose(0, 2, 1)
    return out


def _roots_in_model_plane(roots: np.ndarray, dt: float) -> np.ndarray:
    if dt:
        return (1 + roots * dt / 2) / (1 - roots * dt / 2)
    return roots


def expected_ratio(dof: np.ndarray, n_outputs: int = 1) -> np.ndarray:
    """Return the mean of |residual|^2 / var on each line, for a variance estimated from `dof`
    windows.

    It is infinite at one window and less: for fewer than two beyond the outputs the value at two is
    returned.

    >>> [round(float(mean), 3) for mean in expected_ratio(np.array([0.9, 3.0, 11.0]))]
    [1.5, 1.5, 1.1]
    """
    enough = np.maximum(dof, n_outputs + 2.0)
    return np.asarray(enough / (enough - n_outputs))


def probability_of_cost(cost: float, dof: np.ndarray, n_parameters: float) -> float:
    """Return the probability that scatter alone leaves a cost at least as large; nan without
    variances.

    Each |residual|^2 / var is F(2, 2 dof) distributed; their sum has the gamma distribution of the
    same mean and variance. Neighbouring lines share the windows of their variances. The scatter of
    these variances averages out only over the number of windows, which is the number of lines over
    dof.
    """
    if np.isnan(dof).any():
        return float("nan")
    from scipy.special import gammaincc

    d, ratio = np.maximum(dof, 3.0), expected_ratio(dof)
    left = 1 - n_parameters / (2 * d.size)
    if left <= 0:
        return float("nan")
    mean = float(np.sum(ratio)) * left
    own = float(np.sum(ratio**2))
    shared = float(
        np.sum(np.where(dof > 1e6, 0.0, ratio**2 * np.minimum(d, d.size) / np.maximum(d - 2, 1)))
    )
    variance = (own + shared) * left
    return float(gammaincc(mean**2 / variance, mean / variance * cost))


def format_roots(known: FitUncertainty | None, discrete: bool, unit: str) -> str:
    """Return poles, zeros and static gain with their standard deviations, one line for each kind; a
    pair once.
    """
    if known is None:
        return ""
    text, unit_of_roots = "", "" if discrete else " rad/s"
    for name, roots, std in (
        ("poles", known.poles, known.std_poles),
        ("zeros", known.zeros, known.std_zeros),
    ):
        each = [
            f"{r.real:.4g}" + (f" ± {abs(r.imag):.4g}j" if r.imag else "") + f" (std {sd:.2g})"
            for r, sd in zip(roots, std, strict=True)
            if r.imag >= 0
        ]
        text += f"\n  {name}{unit_of_roots}: {', '.join(each)}" if each else ""
    if known.std_static_gain < _MAX_STATIC_STD:
        static = (
            f"{known.static_gain:.4g} {unit}".strip()
            + f" (relative std {known.std_static_gain:.2g})"
        )
    else:
        static = "not determined by the lines"
    text += f"\n  static gain: {static}"
    return text + (
        "" if np.isnan(known.std_delay) else f"; delay: std {known.std_delay * 1e3:.2g} ms"
    )
