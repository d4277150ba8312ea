"""Fit of one measured level: spring, mass and damper of a machine whose friction partly slips, with a misfit test.

The reaction at the friction port, force over displacement, is 1/G of a single mass; around a nominal machine it is the
friction N that explains the difference. Either is fitted over all lines by

    H(w) = k - m w^2 + j c w + a j w/(j w + b),    a >= 0,  b inside the band,

weighted by the variance of every line. The last term is an element that slips: the motion at the resonance lets it
slip, so that it is a damper far below b and a spring a far above. Without it a level that slips misses its lines by
several times their scatter, and the mass by 2 % and more (Maxwell slip of 64 kN/m on 80 kN/m).

Two stiffnesses come out. The one without the last term is k_eq, that of the whole friction at this amplitude. k with
that term is what is left below the rate at which elements slip: what slips is not in it, what sticks is.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import f as f_distribution

from nlfrf import Bla
from nlfrf.shared.values import value
from robust.friction_proof.port_levels import port_responses
from robust.sliding.machine import SlidingMachine

__all__ = ["FEWEST_LINES", "SIGMAS", "LevelFit", "fit_level", "nominal_reaction", "one_mass_reaction"]

FEWEST_LINES = 8
#: Half-width of every interval, in standard deviations.
SIGMAS = 3.0
#: Error of a linear model relative to |G| that no refusal is made of (calibration, finite steps of a simulation).
#: Without noise and distortion the variances are at rounding, where every model misses them.
MODEL_ERROR = 0.01
#: Chance that the misfit test refuses a level that the model explains.
FALSE_ALARM = 1e-3
#: Rates b that are tried, per level. Twice as many move the bounds of k by less than 1 % of the fitted standard
#: deviation (the six frictions of benchmarks/read_class.py).
N_RATES = 40
#: Gauss-Newton steps for the delay.
DELAY_STEPS = 8


@value
class Reaction:
    """Reaction at the friction port over the lines of a level.

    Fields
    ------
    omega : (W,) ndarray
        [rad/s].
    H, std : (W,) ndarray
        Force over displacement [N/m], and its standard deviation, the model error included.
    delayed : callable
        H for a measured FRF that is less delayed by tau [s], and its derivative by tau.
    dof : (W,) ndarray
        Complex degrees of freedom behind the variance of each line.
    """

    omega: np.ndarray
    H: np.ndarray
    std: np.ndarray
    delayed: Callable[[float], tuple[np.ndarray, np.ndarray]]
    dof: np.ndarray


@value
class LevelFit:
    """What one level gives.

    Fields
    ------
    force : float
        Rms of the force [N].
    stiffness, damping : float
        k_eq [N/m] and c [Ns/m] of the fit without the slipping element.
    stiffness_std : float
        Its standard deviation [N/m].
    mass, mass_std : float
        [kg], from the fit with the slipping element.
    slow : float
        k [N/m] of the fit with the slipping element.
    slow_low, slow_high : float
        Its profile-likelihood interval of `SIGMAS` standard deviations [N/m].
    misfit, misfit_limit : float
        Mean square misfit over the variance of the lines with the slipping element, and where it is refused.
    slips_below : float
        Lowest line [Hz] where the element slips more slowly than it, so that most of it is read as k; else nan.
    delay, delay_std : float
        Delay [s] that is in the data beyond the model, and its standard deviation.
    misfit_without_delay : float
        The misfit once that delay is taken off.
    softening, softening_std : float
        Coefficient of -w^4 [N s^4/m] that a fit with this term asks for, and its standard deviation: a load on a spring
        of antiresonance w_a far above the band adds m_load/w_a^2 to it.
    """

    force: float
    stiffness: float
    damping: float
    stiffness_std: float
    mass: float
    mass_std: float
    slow: float
    slow_low: float
    slow_high: float
    misfit: float
    misfit_limit: float
    slips_below: float
    delay: float
    delay_std: float
    misfit_without_delay: float
    softening: float
    softening_std: float


@value
class Solution:
    """Weighted least squares: parameters, covariance, weighted residuals, and the rate of the slipping element."""

    found: np.ndarray
    covariance: np.ndarray
    chi: float
    residual: np.ndarray
    rate: float


def one_mass_reaction(bla: Bla) -> Reaction:
    """1/G, the reaction of a single mass with friction where the force acts."""
    omega, G, relative = bla.omega, bla.G, relative_std(bla)

    def delayed(tau: float) -> tuple[np.ndarray, np.ndarray]:
        H = np.exp(-1j * omega * tau) / G
        return H, -1j * omega * H

    return Reaction(omega=omega, H=1 / G, std=relative / np.abs(G), delayed=delayed, dof=bla.dof)


def nominal_reaction(bla: Bla, machine: SlidingMachine, nominal_error: np.ndarray | float = 0.0) -> Reaction:
    """The friction N at the port of a machine: G = G_ym - G_yp N G_xm/(1 + N G_xp), times its delay, solved for N.

    nominal_error : (W,) standard deviation of the machine's own response, relative to it.
    """
    omega = bla.omega
    ym, yp, xm, xp = port_responses(machine, omega)

    def delayed(tau: float) -> tuple[np.ndarray, np.ndarray]:
        G = bla.G * np.exp(1j * omega * (machine.delay + tau))
        away = ym - G
        below = yp * xm - away * xp
        return away / below, -yp * xm / below**2 * 1j * omega * G

    H = delayed(0.0)[0]
    sensitivity = np.abs((1 + H * xp) ** 2 / (yp * xm))
    # an error of G_ym alone moves N by 1/(G_yp G_xm) where force, sensor and port are one, and about so elsewhere
    std = np.hypot(relative_std(bla) * np.abs(bla.G) * sensitivity, nominal_error * np.abs(ym / (yp * xm)))
    return Reaction(omega=omega, H=H, std=std, delayed=delayed, dof=bla.dof)


def relative_std(bla: Bla) -> np.ndarray:
    """(W,) standard deviation of G relative to |G|, with the error that a linear model may have."""
    return np.asarray(np.sqrt(bla.var_total / np.abs(bla.G) ** 2 + MODEL_ERROR**2))


def fit_level(bla: Bla, reaction: Reaction) -> LevelFit:
    """Fit one level, with and without a slipping element, and test it for misfit and delay."""
    plain, solutions = fit_rates(reaction.omega, reaction.H, reaction.std)
    best = min(solutions, key=lambda one: one.chi)
    free = 2 * reaction.omega.size - 5
    misfit = best.chi / free
    spread = variance_inflation(best, misfit)
    tau, tau_std, left = fit_delay(reaction, best)
    softening, softening_std = fit_softening(reaction, best)
    slow_low, slow_high = profile(solutions, 0, best.chi, spread)
    too_slow = best.rate <= reaction.omega[0] and plain.chi - best.chi > SIGMAS**2 * spread
    return LevelFit(
        force=float(np.sqrt((np.abs(bla.levels.excited / bla.G) ** 2).sum(axis=1).mean() / 2)),
        stiffness=float(plain.found[0]),
        damping=float(plain.found[2]),
        stiffness_std=float(np.sqrt(plain.covariance[0, 0] * variance_inflation(plain, plain.chi / (free + 2)))),
        mass=float(best.found[1]),
        mass_std=float(np.sqrt(best.covariance[1, 1] * spread)),
        slow=float(best.found[0]),
        slow_low=slow_low,
        slow_high=slow_high,
        misfit=misfit,
        misfit_limit=misfit_limit(reaction.dof, free),
        slips_below=float(bla.f[0]) if too_slow else np.nan,
        delay=tau,
        delay_std=tau_std,
        misfit_without_delay=left,
        softening=softening,
        softening_std=softening_std,
    )


def fit_rates(omega: np.ndarray, H: np.ndarray, std: np.ndarray) -> tuple[Solution, list[Solution]]:
    """The fit without a slipping element, and all that count: that one, and one for each rate with a >= 0."""
    plain = least_squares(columns_of(omega, np.nan), H, std, np.nan)
    slipping = (least_squares(columns_of(omega, b), H, std, b) for b in np.geomspace(omega[0], omega[-1], N_RATES))
    return plain, [plain, *(one for one in slipping if one.found[3] >= 0)]


def columns_of(omega: np.ndarray, rate: float) -> np.ndarray:
    """(W, 3 or 4) columns of k, m, c, and of a where the element has a rate."""
    columns = [np.ones(omega.size), -(omega**2), 1j * omega]
    if np.isfinite(rate):
        columns.append(1j * omega / (1j * omega + rate))
    return np.column_stack(columns)


def least_squares(columns: np.ndarray, wanted: np.ndarray, std: np.ndarray, rate: float) -> Solution:
    """Real parameters of complex columns, by QR of the columns scaled to unit length."""
    table = np.vstack([(columns / std[:, None]).real, (columns / std[:, None]).imag])
    target = np.concatenate([(wanted / std).real, (wanted / std).imag])
    unit = np.linalg.norm(table, axis=0)
    unit[unit == 0] = 1.0
    Q, R = np.linalg.qr(table / unit)
    inverse = np.linalg.pinv(R)
    found = inverse @ (Q.T @ target)
    left = target - table / unit @ found
    n = wanted.size
    return Solution(
        found=found / unit,
        covariance=inverse @ inverse.T / np.outer(unit, unit),
        chi=float(left @ left),
        residual=left[:n] + 1j * left[n:],
        rate=rate,
    )


def variance_inflation(solution: Solution, misfit: float) -> float:
    """Factor on the variances of a fit: its misfit above one, and neighbouring residuals that are alike.

    Distortion of random phases is independent from line to line. Residuals with a correlation r between neighbours are
    a smooth error of the model, and count as (1 - r)/(1 + r) times as many lines.
    """
    r = solution.residual
    power = float((np.abs(r) ** 2).sum())
    alike = float((r[1:] * r[:-1].conj()).real.sum()) / power if power > 0 else 0.0
    alike = float(np.clip(alike, 0.0, 0.99))
    return max(1.0, misfit) * (1 + alike) / (1 - alike)


def profile(solutions: list[Solution], i: int, least: float, spread: float) -> tuple[float, float]:
    """Profile-likelihood interval of parameter i over all rates of the slipping element."""
    low, high = np.inf, -np.inf
    for one in solutions:
        room = SIGMAS**2 * spread - (one.chi - least)
        if room >= 0:
            reach = float(np.sqrt(one.covariance[i, i] * room))
            low, high = min(low, one.found[i] - reach), max(high, one.found[i] + reach)
    return float(low), float(high)


def misfit_limit(dof: np.ndarray, free: int) -> float:
    """Misfit that lines of a right model exceed with the chance `FALSE_ALARM`.

    A squared residual over a variance of L complex degrees of freedom is F(2, 2 L), of mean L/(L - 1). The windows
    behind the variances overlap, so that each line brings at most one degree of freedom of its own to their mean.
    """
    worth = np.clip(dof, 2.0, 1e9)
    mean = float(np.mean(worth / (worth - 1)))
    return mean * float(f_distribution.ppf(1 - FALSE_ALARM, free, 2 * np.minimum(worth, 1.0).sum()))


def fit_delay(reaction: Reaction, best: Solution) -> tuple[float, float, float]:
    """Delay [s] that is left in the data, its standard deviation, and the misfit once it is taken off."""
    omega, tau, base = reaction.omega, 0.0, columns_of(reaction.omega, best.rate)
    for _ in range(DELAY_STEPS):
        H, slope = reaction.delayed(tau)
        solution = least_squares(np.column_stack([base, -slope]), H, reaction.std, best.rate)
        tau += float(solution.found[-1])
    misfit = solution.chi / (2 * omega.size - 6)
    variance = float(solution.covariance[-1, -1]) * variance_inflation(solution, misfit)
    # the model error may be alike on all lines, and is then no less for their number
    precision = np.abs(reaction.H / reaction.std) ** 2
    variance += MODEL_ERROR**2 * float(precision.sum() / (precision @ omega**2))
    return tau, float(np.sqrt(variance)), misfit


def fit_softening(reaction: Reaction, best: Solution) -> tuple[float, float]:
    """Coefficient of -w^4 [N s^4/m] and its standard deviation: the first sign of a mode above the band.

    One term is tested with far more power than the misfit as a whole, which a mode at twice the highest line does not
    raise by 1 % where that line has a few per cent of noise.
    """
    omega, H, std = reaction.omega, reaction.H, reaction.std
    columns = np.column_stack([columns_of(omega, best.rate), -(omega**4)])
    solution = least_squares(columns, H, std, best.rate)
    misfit = solution.chi / (2 * omega.size - columns.shape[1] - 1)
    variance = float(solution.covariance[-1, -1]) * variance_inflation(solution, misfit)
    precision = (omega**4 / std) ** 2  # of the lines for this term, and the model error that they may share
    variance += MODEL_ERROR**2 * float((precision @ np.abs(H / omega**4) ** 2) / precision.sum())
    return float(solution.found[-1]), float(np.sqrt(variance))
