"""Machine and friction stiffness from BLAs at several levels, or an error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import f as f_distribution

from nlfrf import Bla
from nlfrf._base.values import value
from robust.friction.nominal import error_of_nominal, machines_of_nominal
from robust.friction.plant import FrictionPlant, friction_plant, with_port_impedance
from robust.friction.reading.assumed_class import MachineRead
from robust.friction.reading.levels import require_levels, weighted_mean
from robust.friction.units import MechanicalUnits, mechanical_units
from robust.lti.sampling import hold_correction

# ---- Fit of one measured level: spring, mass and damper of a machine whose friction partly slips,
# with a misfit test.
#
# The reaction N at the friction port, force over displacement, is the difference of a level from a
# machine: a nominal, or one free mass, for which it is 1/G without that mass. It is fitted over all
# lines by
#
#     H(w) = k - m w^2 + j c w + a j w/(j w + b),    a >= 0,  b inside the band,
#
# weighted by the variance of every line. The last term is an element that slips: at frequencies far
# below b it is a damper, far above b a spring a. Without it a level that slips misses its lines by
# several times their scatter, and the mass by 2 % and more (Maxwell slip of 64 kN/m on 80 kN/m).
#
# Two stiffnesses result. The fit without the last term gives k_eq, that of the whole friction at
# this amplitude. In the fit with that term k is the stiffness below the rate of slip: without
# elements that slip, with elements that stick.

#: Half-width of every interval, in standard deviations.
SIGMAS = 3.0
#: Error of a linear model relative to |G| that causes no refusal (calibration, finite steps of a
#: simulation). Without noise and distortion the variances are at rounding, and every model misses
#: them.
_MODEL_ERROR = 0.01
#: Probability that the misfit test refuses a level that the model explains.
_FALSE_ALARM = 1e-3
#: Number of rates b that are tried at a level. Twice as many move the bounds of k by less than 1 %
#: of the fitted standard deviation (the six frictions of benchmarks/read_class.py).
_N_RATES = 40
#: Gauss-Newton steps for the delay.
_DELAY_STEPS = 8


@value
class _Reaction:
    """Reaction at the friction port over the lines of a level."""

    omega: np.ndarray  # (W,) [rad/s]
    # H, std: (W,) force over displacement [N/m], and its standard deviation, which includes the
    # model error
    H: np.ndarray
    std: np.ndarray
    gain: np.ndarray  # (W,) change of H [N/m] if G changes by its own size
    # function of tau [s]: H for a measured FRF with a delay shorter by tau, and its derivative by
    # tau
    delayed: Callable[[float], tuple[np.ndarray, np.ndarray]]
    dof: np.ndarray  # (W,) complex degrees of freedom behind the variance of each line


@value
class _LevelFit:
    """Estimates from one level."""

    force: float  # rms of the force [N]
    # stiffness, stiffness_std: k_eq of the fit without the slipping element, and its standard
    # deviation [N/m]
    stiffness: float
    stiffness_std: float
    # mass, mass_std: mass [kg] from the fit with the slipping element, including that of the
    # machine at its port
    mass: float
    mass_std: float
    slow: float  # k [N/m] of the fit with the slipping element
    # slow_low, slow_high: its profile-likelihood interval of `SIGMAS` standard deviations [N/m]
    slow_low: float
    slow_high: float
    # misfit, misfit_limit: mean square misfit over the variance of the lines with the slipping
    # element, and its limit for a refusal
    misfit: float
    misfit_limit: float
    # lowest line [Hz] if the element slips more slowly than it, so that most of the element counts
    # as k; else nan
    slips_below: float
    # delay, delay_std: delay [s] in the data beyond that of the model, and its standard deviation
    delay: float
    delay_std: float
    misfit_without_delay: float  # misfit after that delay is removed
    # softening, softening_std: coefficient of -w^4 [N s^4/m] in a fit with this term, and its
    # standard deviation: a load on a spring with an antiresonance w_a far above the band adds
    # m_load/w_a^2 to it
    softening: float
    softening_std: float


@value
class _Solution:
    """Weighted least squares: parameters, covariance, weighted residuals, and the rate of the
    slipping element.
    """

    found: np.ndarray
    covariance: np.ndarray
    chi: float
    residual: np.ndarray
    rate: float


def _reaction_around(bla: Bla, machine: FrictionPlant, error: np.ndarray | float) -> _Reaction:
    """Return the reaction N at the port of a machine:

    G = G_ym - G_yp N G_xm/(1 + N G_xp), with its delay, for N.

    error : (W,) standard deviation of the response of the machine, relative to it.
    """
    omega = bla.omega
    ym, yp, xm, xp = _port_responses(machine, omega)

    def delayed(tau: float) -> tuple[np.ndarray, np.ndarray]:
        G = bla.G * np.exp(1j * omega * (machine.delay + tau))
        away = ym - G
        below = yp * xm - away * xp
        return away / below, -yp * xm / below**2 * 1j * omega * G

    H, slope = delayed(0.0)
    gain = np.abs(slope) / omega
    # an error of G_ym alone changes N by 1/(G_yp G_xm) if force, sensor and port are one, and by
    # about that elsewhere
    std = np.hypot(_relative_std(bla) * gain, error * np.abs(ym / (yp * xm)))
    return _Reaction(omega=omega, H=H, std=std, gain=gain, delayed=delayed, dof=bla.dof)


def _free_mass(bla: Bla) -> FrictionPlant:
    """Return the mass that the highest line shows without spring and friction: the machine if none
    was given.
    """
    return friction_plant(float(1 / (bla.omega[-1] ** 2 * np.abs(bla.G[-1]))), 0.0)


def _port_responses(machine: FrictionPlant, omega: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return (W,) each: measured over force, measured over port force, port displacement over force
    and port force.
    """
    n = machine.A.shape[0]
    pencil = 1j * omega[:, None, None] * (1 + 1e-9) * np.eye(n) - machine.A
    push = np.broadcast_to(
        np.column_stack([machine.B_force, machine.B_port]).astype(complex), (omega.size, n, 2)
    )
    moved = np.linalg.solve(pencil, push)
    matrices = np.vstack([machine.C_measured, machine.C_port]) @ moved
    return matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 0], matrices[:, 1, 1]


def _relative_std(bla: Bla) -> np.ndarray:
    """Return (W,) standard deviation of G over |G|, with the error of a linear model."""
    return np.asarray(np.sqrt(bla.var_total / np.abs(bla.G) ** 2 + _MODEL_ERROR**2))


def _port_mass(machine: FrictionPlant) -> float:
    """Return the mass [kg] that a force at the friction port accelerates at once."""
    return 1 / float(machine.velocity @ machine.B_port)


def _fit_level(bla: Bla, machine: FrictionPlant, error: np.ndarray | float = 0.0) -> _LevelFit:
    """Fit the part of one level that a machine does not explain, with and without a slipping
    element; test the fit.

    error : (W,) standard deviation of the response of the machine, relative to it.
    """
    reaction = _reaction_around(bla, machine, error)
    omega, H, std = reaction.omega, reaction.H, reaction.std
    plain = _least_squares(_regressors(omega, np.nan), H, std=std, rate=np.nan)
    slipping = (
        _least_squares(_regressors(omega, b), H, std=std, rate=b)
        for b in np.geomspace(omega[0], omega[-1], _N_RATES)
    )
    solutions = [plain, *(one for one in slipping if one.found[3] >= 0)]
    best = min(solutions, key=lambda one: one.chi)
    free = 2 * reaction.omega.size - 5
    misfit = best.chi / free
    spread = _variance_inflation(best, misfit)
    tau, tau_std, left = _fit_delay(reaction, best)
    softening, softening_std = _fit_softening(reaction, best)
    slow_low, slow_high = _profile_interval(solutions, 0, least=best.chi, spread=spread)
    too_slow = best.rate <= reaction.omega[0] and plain.chi - best.chi > SIGMAS**2 * spread
    return _LevelFit(
        force=float(np.sqrt((np.abs(bla.levels.excited / bla.G) ** 2).sum(axis=1).mean() / 2)),
        stiffness=float(plain.found[0]),
        stiffness_std=float(
            np.sqrt(plain.covariance[0, 0] * _variance_inflation(plain, plain.chi / (free + 2)))
        ),
        mass=_port_mass(machine) + float(best.found[1]),
        mass_std=float(np.sqrt(best.covariance[1, 1] * spread)),
        slow=float(best.found[0]),
        slow_low=slow_low,
        slow_high=slow_high,
        misfit=misfit,
        misfit_limit=_misfit_limit(reaction.dof, free),
        slips_below=float(bla.f[0]) if too_slow else np.nan,
        delay=tau,
        delay_std=tau_std,
        misfit_without_delay=left,
        softening=softening,
        softening_std=softening_std,
    )


def _regressors(omega: np.ndarray, rate: float) -> np.ndarray:
    """Return the (W, 3 or 4) columns of k, m, c, and of a if the slipping element has a rate."""
    columns = [np.ones(omega.size), -(omega**2), 1j * omega]
    if np.isfinite(rate):
        columns.append(1j * omega / (1j * omega + rate))
    return np.column_stack(columns)


def _least_squares(
    columns: np.ndarray, wanted: np.ndarray, *, std: np.ndarray, rate: float
) -> _Solution:
    """Return real parameters for complex columns, by QR of the columns scaled to unit length."""
    table = np.vstack([(columns / std[:, None]).real, (columns / std[:, None]).imag])
    target = np.concatenate([(wanted / std).real, (wanted / std).imag])
    unit = np.linalg.norm(table, axis=0)
    unit[unit == 0] = 1.0
    Q, R = np.linalg.qr(table / unit)
    inverse = np.linalg.pinv(R)
    found = inverse @ (Q.T @ target)
    left = target - table / unit @ found
    n = wanted.size
    return _Solution(
        found=found / unit,
        covariance=inverse @ inverse.T / np.outer(unit, unit),
        chi=float(left @ left),
        residual=left[:n] + 1j * left[n:],
        rate=rate,
    )


def _variance_inflation(solution: _Solution, misfit: float) -> float:
    """Return a factor on the variances of a fit: its misfit above one, and the correlation of
    neighbouring residuals.

    Distortion of random phases is independent from line to line. Residuals with a correlation r
    between neighbours are a smooth model error, and count as (1 - r)/(1 + r) times as many lines.
    """
    r = solution.residual
    power = float((np.abs(r) ** 2).sum())
    if power > 0:
        autocorrelation = float((r[1:] * r[:-1].conj()).real.sum()) / power
    else:
        autocorrelation = 0.0
    autocorrelation = float(np.clip(autocorrelation, 0.0, 0.99))
    return max(1.0, misfit) * (1 + autocorrelation) / (1 - autocorrelation)


def _profile_interval(
    solutions: list[_Solution], i: int, *, least: float, spread: float
) -> tuple[float, float]:
    """Return the profile-likelihood interval of parameter i over all rates b."""
    low, high = np.inf, -np.inf
    for one in solutions:
        allowance = SIGMAS**2 * spread - (one.chi - least)
        if allowance >= 0:
            reach = float(np.sqrt(one.covariance[i, i] * allowance))
            low, high = min(low, one.found[i] - reach), max(high, one.found[i] + reach)
    return float(low), float(high)


def _misfit_limit(dof: np.ndarray, free: int) -> float:
    """Return the misfit that lines of a right model exceed with probability `_FALSE_ALARM`.

    A squared residual over a variance of L complex degrees of freedom is F(2, 2 L), with mean L/(L
    - 1). The windows behind the variances overlap, so each line contributes at most one degree of
    freedom of its own to their mean.
    """
    worth = np.clip(dof, 2.0, 1e9)
    mean = float(np.mean(worth / (worth - 1)))
    return mean * float(
        f_distribution.ppf(1 - _FALSE_ALARM, free, 2 * np.minimum(worth, 1.0).sum())
    )


def _fit_delay(reaction: _Reaction, best: _Solution) -> tuple[float, float, float]:
    """Return the remaining delay of the data [s], its standard deviation, and the misfit after it
    is removed.
    """
    tau = 0.0
    for _ in range(_DELAY_STEPS):
        H, slope = reaction.delayed(tau)
        step, std, misfit = _fit_one_more(
            replace(reaction, H=H), best, -slope, size=reaction.gain * reaction.omega
        )
        tau += step
    return tau, std, misfit


def _fit_softening(reaction: _Reaction, best: _Solution) -> tuple[float, float]:
    """Return the coefficient of -w^4 [N s^4/m] and its standard deviation: the first sign of a mode
    above the band.

    A test of one term has far more power than the total misfit: a mode at twice the highest line
    raises the misfit by less than 1 % if that line has a few per cent of noise.
    """
    return _fit_one_more(reaction, best, -(reaction.omega**4), size=reaction.omega**4)[:2]


def _fit_one_more(
    reaction: _Reaction, best: _Solution, column: np.ndarray, *, size: np.ndarray
) -> tuple[float, float, float]:
    """Return amount, standard deviation and misfit of one more term with this column (W,); size :
    of the term.

    The model error may be equal on all lines, so its contribution does not fall with their number.
    """
    columns = np.column_stack([_regressors(reaction.omega, best.rate), column])
    solution = _least_squares(columns, reaction.H, std=reaction.std, rate=best.rate)
    misfit = solution.chi / (2 * reaction.omega.size - columns.shape[1] - 1)
    variance = float(solution.covariance[-1, -1]) * _variance_inflation(solution, misfit)
    precision = np.abs(size / reaction.std) ** 2
    variance += _MODEL_ERROR**2 * float(
        (precision @ np.abs(reaction.gain / size) ** 2) / precision.sum()
    )
    return float(solution.found[-1]), float(np.sqrt(variance)), misfit


#: Largest share of the friction stiffness that may be missing at the second lowest level, and that
#: the extrapolation to rest may add to the lowest. Sliding friction loses at least the power 3/2 of
#: its stiffness in amplitude, so two levels that slide fail one of the two conditions, whatever
#: their ratio.
_STIFFNESS_AGREEMENT = 0.2


@value
class _Model:
    """The machine around which the levels are fitted."""

    # the machine with each damping of a proof; the levels are fitted around the last
    machines: tuple[FrictionPlant, ...]
    error: list[
        np.ndarray
    ]  # (L, W) standard deviation of its response at the lines of each level, relative to it
    least: float  # lowest stiffness that may be added to it [N/m]
    # name, order, cure: phrases: the model, the model with its friction at one level, and advice
    # for another model
    name: str
    order: str
    cure: str
    description: str  # phrase for the evidence


def _model_of(blas: list[Bla], nominal: object) -> _Model:
    """Return the nominal as a machine, or one free mass if there is no nominal."""
    if nominal is None:
        return _Model(
            machines=(_free_mass(blas[0]),),
            error=[np.zeros(bla.f.size) for bla in blas],
            least=0.0,
            name="one mass",
            order="one mass on a spring",
            cure="Give a nominal: fit_nominal(blas[0], n_poles=4, n_zeros=2)",
            description="",
        )
    machines, description = machines_of_nominal(nominal)
    return _Model(
        machines=machines,
        error=[error_of_nominal(nominal, bla.omega) for bla in blas],
        least=-np.inf,
        name="the nominal",
        order="the nominal and a friction at its port",
        cure=(
            "Give a nominal of higher order, or fitted at the lowest level, where the friction is a"
            " spring"
        ),
        description=description,
    )


def read_blas(blas: list[Bla], nominal: object) -> MachineRead:
    """Return machine and presliding stiffness from the BLAs of three levels or more; see
    `machine_with_friction`.
    """
    own = getattr(nominal, "position_unit", "")
    position_unit = require_levels(
        "blas", [(bla.y_unit or own, bla.u_unit) for bla in blas], [bla.f.size for bla in blas]
    )
    if not all(np.isfinite(bla.levels.excited).all() for bla in blas):
        raise ValueError(
            "blas must contain the amplitude of the output, which an FRF of another program"
            " (nlfrf.bla_from_frf) does not: use BLAs from nlfrf.identify"
        )
    units = mechanical_units(position_unit)
    holds = [hold_correction(bla.omega, bla.hold, fs=bla.fs, dt=0.0) for bla in blas]
    blas = [
        bla.times(one, output_unit=bla.output_units) for bla, one in zip(blas, holds, strict=True)
    ]
    model, fits = _fit_around(blas, _model_of(blas, nominal))
    fits.sort(key=lambda fit: -fit.force)
    mass, mass_std = _read_mass(fits, model, units)
    low, rest, fell = _read_stiffness(fits, model, units)
    top, kilo = fits[0], units.stiffness
    if nominal is None:
        machines: tuple[FrictionPlant, ...] = (
            friction_plant(mass, low, position_unit=position_unit),
        )
    else:
        added = [mass - _port_mass(model.machines[-1])] * len(model.machines)
        machines = tuple(
            replace(with_port_impedance(one, low, more), position_unit=position_unit)
            for one, more in zip(model.machines, added, strict=True)
        )
    lowest, highest = max(bla.f[0] for bla in blas), min(bla.f[-1] for bla in blas)
    if fell:
        fallen = f" and {fell / 1e3:.2g} {kilo}, its fall over the last doubling of the force,"
    else:
        fallen = ""
    widened = (
        f"{SIGMAS:g} standard deviations{fallen} below the {top.slow / 1e3:.4g} {kilo} of the"
        " highest level"
    )
    around, where, damping = "", "", f", c = 0 {units.damping}"
    if model.description:
        around = f"around {model.description}; at the friction port "
        where = " beside it"
        damping = ""
    return MachineRead(
        machines=machines,
        mass=mass,
        mass_std=mass_std,
        stiffness=top.slow,
        stiffness_low=low,
        stiffness_std=top.stiffness_std,
        K0=np.array([rest - top.slow]),
        stiction=np.array([np.nan]),
        source=(
            f"read from {len(fits)} levels from {lowest:.3g} to {highest:.4g} Hz (without modes"
            " above this band)"
        ),
        description=(
            f"{around}m = {mass:.4g} +- {mass_std:.1g} {units.mass} (one standard deviation), k ="
            f" {low / 1e3:.4g} {kilo}{where} ({widened}){damping}"
        ),
        K0_note=(
            f"the difference between {rest / 1e3:.4g} {kilo} at rest and the highest level, plus"
            " the reduction of k"
        ),
        stiction_note="",
        misfit=(
            f"misfit at most {max(fit.misfit for fit in fits):.2g} times the variance of the lines"
        ),
    )


def _fit_around(blas: list[Bla], model: _Model) -> tuple[_Model, list[_LevelFit]]:
    """Fit the part of every level that a machine does not explain; return the model with its delay,
    and the fits.
    """

    def fitted(machine: FrictionPlant) -> list[_LevelFit]:
        return [
            _fit_level(bla, machine, error) for bla, error in zip(blas, model.error, strict=True)
        ]

    fits, known = fitted(model.machines[-1]), model.machines[-1].delay
    if not known:
        return model, fits
    # a delay that was estimated while friction slips has absorbed some of its phase: all levels
    # together are better
    tau = weighted_mean([fit.delay for fit in fits], [fit.delay_std for fit in fits])[0]
    machines = tuple(replace(one, delay=max(0.0, known + tau)) for one in model.machines)
    description = f"{model.description}, with {1e3 * machines[-1].delay:.4g} ms of delay"
    return replace(model, machines=machines, description=description), fitted(machines[-1])


def _read_stiffness(
    fits: list[_LevelFit], model: _Model, units: MechanicalUnits
) -> tuple[float, float, float]:
    """Return the lowest stiffness at the highest level, the largest at rest [N/m], and the fall per
    octave of force.

    The highest level comes first. Levels that do not determine the stiffness are refused.
    """
    top, lowest = fits[0], fits[-1]
    second = next((fit for fit in fits if fit.force <= top.force / 2), lowest)
    fell = max(0.0, second.slow - top.slow) / max(1.0, float(np.log2(top.force / second.force)))
    low = max(model.least, top.slow_low - fell)
    lost = lowest.stiffness - top.slow
    if not lost > SIGMAS * np.hypot(lowest.stiffness_std, (top.slow_high - top.slow) / SIGMAS):
        raise ValueError(
            "blas must span from sticking to sliding, got stiffnesses from"
            f" {top.stiffness / 1e3:.4g} to {lowest.stiffness / 1e3:.4g} {units.stiffness}"
        )
    if np.isfinite(top.slips_below):
        raise ValueError(
            "blas must contain a level at which the friction slides: at the highest level it"
            f" slips only below the lowest line, at {top.slips_below:.3g} Hz, and cannot be"
            " distinguished from a spring of the machine. Measure at a higher level, or from a"
            " lower frequency on"
        )
    if top.slow - low > lost:
        raise ValueError(
            "blas must contain a level at which the friction slides: at the highest level the"
            f" stiffness is uncertain by {(top.slow - low) / 1e3:.4g} {units.stiffness}, which"
            f" is more than its decrease by sliding ({lost / 1e3:.4g} {units.stiffness})."
            " Measure at a higher level, or longer"
        )
    return low, _stiffness_at_rest(fits, lost, units=units), fell


def _read_mass(fits: list[_LevelFit], model: _Model, units: MechanicalUnits) -> tuple[float, float]:
    """Return mass and its standard deviation [kg]; refuse a reversed sign, a delay, and levels that
    no model fits.
    """
    if all(fit.mass < -SIGMAS * fit.mass_std for fit in fits):
        raise ValueError(
            f"blas must be from force to position, got a mass of {fits[0].mass:.3g} {units.mass}:"
            " the output falls when the input rises. Reverse the sign of the sensor"
        )
    tau, tau_std = weighted_mean([fit.delay for fit in fits], [fit.delay_std for fit in fits])
    worst = max(fits, key=lambda fit: fit.misfit / fit.misfit_limit)
    explained = all(fit.misfit_without_delay <= fit.misfit_limit for fit in fits)
    # a delay or a mode is named only if the fit is good apart from it; a misfit is refused last
    # a lead is not refused: elements with several rates look like up to 0.04 ms of it
    # (benchmarks/read_class.py, seed 0)
    if tau > SIGMAS * tau_std and (explained or worst.misfit <= worst.misfit_limit):
        raise ValueError(
            f"blas must have no other delay than {model.name}, got {1e3 * tau:.3g} +-"
            f" {1e3 * tau_std:.1g} ms more: the loop of the proof would not contain this delay."
            " Give a nominal with it: fit_nominal(blas[0], n_poles=2, n_zeros=0,"
            ' delay="estimate")'
        )
    softening, softening_std = weighted_mean(
        [fit.softening for fit in fits], [fit.softening_std for fit in fits]
    )
    if softening > SIGMAS * softening_std and worst.misfit <= worst.misfit_limit:
        raise ValueError(
            f"blas must have no mode that {model.name} does not contain, got a dynamic"
            f" stiffness with a term -w^4 of {softening:.2g} +- {softening_std:.1g}"
            f" {units.force} s^4/{units.position}, the effect of a mode above the band: the loop"
            " of the proof would not contain this mode. Measure up to this mode, and give a"
            " nominal with it"
        )
    if worst.misfit > worst.misfit_limit:
        raise ValueError(
            f"blas must be of {model.order}: a level misses this model by {worst.misfit:.3g}"
            f" times the variance of its lines ({worst.misfit_limit:.3g} is possible by chance),"
            f" so its mass and stiffness are wrong. {model.cure}"
        )
    return weighted_mean([fit.mass for fit in fits], [fit.mass_std for fit in fits])


def highest_level(blas: Sequence[Bla]) -> int:
    """Return the BLA whose friction slips most: there it adds no stiffness, and the least damping.

    Gains at the lowest line within 5 % of each other count as equal: levels that all slip differ by
    chance only.
    """
    gains = [abs(bla.G[0]) for bla in blas]
    return max(
        range(len(blas)), key=lambda k: (gains[k] > 0.95 * max(gains), np.abs(blas[k].G).max())
    )


def _stiffness_at_rest(fits: list[_LevelFit], lost: float, *, units: MechanicalUnits) -> float:
    """Return the stiffness [N/m] at rest, extrapolated from the lowest level and the most
    informative other one.

    A virgin curve with a second derivative at rest loses stiffness in proportion to the amplitude:
    the loss from rest to the lowest level is the loss between two levels, divided by their ratio
    minus one. Smoother curves lose less. The ratio is that of the forces: at a sharp resonance the
    displacement hardly grows once elements slip.
    """
    lowest = fits[-1]
    allowed, extrapolations = _STIFFNESS_AGREEMENT * lost, []
    for other in fits[-2::-1]:
        difference = max(0.0, lowest.stiffness - other.stiffness)
        spread = SIGMAS * float(np.hypot(lowest.stiffness_std, other.stiffness_std))
        ratio = other.force / lowest.force
        if ratio > 1:
            added = (difference + spread) / (ratio - 1)
        else:
            added = np.inf
        extrapolations.append(
            (added if difference <= allowed else np.inf, added, difference, spread, ratio, other)
        )
    added = min(one[0] for one in extrapolations)
    if added <= allowed:
        return lowest.stiffness + SIGMAS * lowest.stiffness_std + added
    _, added, difference, spread, ratio, other = extrapolations[0]
    if difference > allowed:
        raise ValueError(
            "blas must contain two low levels with the same stiffness, at which the friction"
            f" sticks: it is {other.stiffness / 1e3:.4g} and {lowest.stiffness / 1e3:.4g}"
            f" {units.stiffness} at the two lowest levels, {100 * difference / lost:.3g} % of"
            f" the stiffness of the friction, more than {100 * _STIFFNESS_AGREEMENT:g} %."
            " Measure at a lower level"
        )
    raise ValueError(
        "blas must contain two low levels that differ enough to show that the friction sticks:"
        f" at {ratio:.3g} times the force the stiffness falls by {difference / 1e3:.3g} +-"
        f" {spread / SIGMAS / 1e3:.1g} {units.stiffness}, so the stiffness at rest may be larger"
        f" by {added / 1e3:.3g} {units.stiffness}, which is over {100 * _STIFFNESS_AGREEMENT:g}"
        " % of the stiffness of the friction. Measure at a third of the lowest level"
    )
