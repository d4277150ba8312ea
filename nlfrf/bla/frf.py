"""The FRF averaged over realisations, with its variance by noise and in total, and whether it is one at all.

A smooth FRF turns its phase by the same angle over neighbouring steps between lines that are equally long, whatever its
delay. That of an output over the input of another realisation turns at random.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import TINY, power, squared_modulus
from nlfrf._base.values import value
from nlfrf.bla.calibration import FEW
from nlfrf.bla.localfit import apart_from_neighbours
from nlfrf.bla.neighbours import Places
from nlfrf.bla.realizations import equal_steps
from nlfrf.bla.spectra import Spectra

__all__ = [
    "ROUNDING",
    "Frf",
    "average_frf",
    "refuse_another_reference",
    "refuse_mispaired",
    "residual_variance",
    "warn_of_jumps",
    "warn_of_lines_apart",
]


#: Roughness over the level and over |G|^2 past which u and y do not belong together, where most lines have it.
JUMPING, SHARE = 2.5, 0.03
SPARE = 2  # lines more than the half: few lines are rough by chance
FEWEST = 4  # pairs of equal steps that can tell phases apart
#: Power over that of chance from which a line stands out: over the level, and over the scatter of the lines around it,
#: by which alone one of 4e5 sound lines does; and that of a local fit from which it is looked for.
ABOVE_LEVEL, ABOVE_SCATTER, SUSPECT = 25.0, 60.0, 5.0
MAINS = 50.0, 60.0  # Hz
ROUNDING = 1e-13  # of the whole output, on a line: what stands out of less does so by it
UNRELATED = 3.0  # standard deviations of chance up to which phases agree by it
RELATED = 1e-6  # probability with which chance may make an output follow any input, or turn its sign
TELLING = 30  # pairs of equal steps from which it is said that y follows no input
HIDDEN = 0.5  # of |G|^2 that one realisation adds at least where its phases are random
NOISY = 0.1  # noise over |G|^2 from which it may be the noise that does not follow


@value(copy=False)
class Frf:
    """Averaged FRF on some lines.

    Fields
    ------
    each : (M, F) complex ndarray
        Y / U of each realisation.
    noise : (M, F) ndarray
        Variance of each by noise, to first order; nan for one period.
    G : (F,) complex ndarray
        Their average: the mean, or the ratio of averages where a reference was given.
    var_noise : (F,) ndarray
        Variance of G by noise; nan for one period.
    var_total : (F,) ndarray
        Variance of G by noise and distortion, from the scatter over realisations; nan for M = 1.
    """

    each: np.ndarray
    noise: np.ndarray
    G: np.ndarray
    var_noise: np.ndarray
    var_total: np.ndarray


def average_frf(spectra: Spectra) -> Frf:
    """FRF on the lines of the spectra; see Pintelon & Schoukens, 4.3.1.

    With a reference the spectra are turned by its phase and averaged before they are divided: noise on the input
    then leaves no bias, in open and in closed loop.
    """
    n = spectra.U.shape[0]
    each = spectra.Y / spectra.U
    noise = residual_variance(each, spectra) / spectra.power_U
    if spectra.R is None:
        G = np.add.reduce(each, axis=0) / n
        var_noise = np.add.reduce(noise) / n**2
        var_total = np.add.reduce(squared_modulus(each - G)) / (n * (n - 1)) if n > 1 else np.full(G.shape, np.nan)
        return Frf(each=each, noise=noise, G=G, var_noise=var_noise, var_total=var_total)
    turn = spectra.R.conj() / np.abs(spectra.R)
    U, Y = (spectra.U * turn).mean(axis=0), (spectra.Y * turn).mean(axis=0)
    G = Y / U
    # E|dY - G dU|^2 / |U|^2, by noise and over realisations
    var_noise = np.add.reduce(residual_variance(G, spectra)) / n**2 / squared_modulus(U)
    var_total = np.full(G.shape, np.nan)
    if n > 1:
        deviation = (spectra.Y - G * spectra.U) * turn
        var_total = np.add.reduce(squared_modulus(deviation)) / (n * (n - 1)) / squared_modulus(U)
    return Frf(each=each, noise=noise, G=G, var_noise=var_noise, var_total=var_total)


def residual_variance(G: np.ndarray, spectra: Spectra) -> np.ndarray:
    """(M, K) variance of Y - G U by noise, E|dY - G dU|^2."""
    if not spectra.var_U.any():  # an input that repeats exactly
        return spectra.var_Y
    variance = spectra.var_Y + squared_modulus(G) * spectra.var_U - 2 * (G.conj() * spectra.cov_YU).real
    return np.maximum(variance, 0.0)


def warn_of_jumps(
    rough: np.ndarray, level: np.ndarray, size: np.ndarray, what: str = "G", share: float = SHARE
) -> bool:
    """Warn where an FRF jumps from line to line by more than its distortion can make it.

    Parameters
    ----------
    rough, level, size : (F,) ndarray
        Variance of an FRF about its neighbours, the one that detection lines tell, and |G|^2.
    what : str
        What the FRF is called.
    share : float
        Roughness over |G|^2 past which it is no bend.
    """
    jumps = (rough > JUMPING * level) & (rough > share * size)
    strange = np.count_nonzero(jumps) > jumps.size / 2 + SPARE
    if strange:
        of_size, above = (float(np.median(rough / np.maximum(one, TINY))) for one in (size, level))
        data_warning(
            f"{what} jumps from line to line by {100 * of_size**0.5:.0f} % of its size, {10 * np.log10(above):.0f} dB "
            "more than its detection lines tell of distortion and noise: do u and y belong to the same runs, in the "
            "same order, with one trigger and one sign? If they do it bends within a few lines: record a longer period"
        )
    return bool(strange)


def warn_of_lines_apart(
    G: np.ndarray,
    fitted: np.ndarray,
    level: np.ndarray,
    where: Places,
    f: np.ndarray,
    gamma: np.ndarray | float = 1.0,
    what: str = "G",
) -> np.ndarray:
    """Warn of single lines that neither distortion nor noise can bring so far from their neighbours.

    A disturbance that keeps step with the periods does, as the hum of the mains nearly does: it averages out over
    realisations, and one alone does not show it on its detection lines. So does a resonance narrower than the lines are
    apart. Nobody can tell which.

    Parameters
    ----------
    G, fitted : (n_u, F) complex ndarray
        FRFs of one output in one realisation, and fitted locally.
    level : (F,) ndarray
        Their variance, over gamma.
    where : Places
    f : (F,) ndarray
        Their frequencies [Hz].
    gamma : (n_u, F) ndarray
        By what the variance of each input's FRF is larger.
    what : str
        What they are called.

    Returns
    -------
    (F,) ndarray
        Power by which such lines stand apart, over gamma; zeros elsewhere.
    """
    if f.size < FEW or not (np.mean(squared_modulus(G - fitted) / gamma, axis=0) > SUSPECT * level).any():
        return np.zeros(f.size)
    apart, scatter, spread = apart_from_neighbours(G, where)
    by_chance = spread * np.maximum(ABOVE_SCATTER * np.mean(scatter / gamma, axis=0), ABOVE_LEVEL * level)
    power_apart = np.mean(squared_modulus(apart) / gamma, axis=0)
    told = np.where(power_apart > by_chance, power_apart, 0.0)
    out = np.flatnonzero(told)
    if not out.size:
        return told
    said = ", ".join(f"{f[k]:g}" for k in out[:6]) + (", ..." if out.size > 6 else "")
    worst = int(out[np.argmax(told[out] / level[out])])
    half = (f[1:] - f[:-1]).min() / 2
    hum = next((m for m in MAINS if all(round(f[k] / m) and abs(f[k] - round(f[k] / m) * m) < half for k in out)), None)
    mains = f", as the hum of mains of {hum:g} Hz does" if hum else ""
    data_warning(
        f"{what} stands out of its neighbours at {said} Hz, by {np.sqrt(told[worst] / level[worst]):.0f} times its "
        f"scatter at {f[worst]:g} Hz{mains}: a disturbance in step with the periods, or a resonance narrower than the "
        "lines are apart. The bound there holds what the neighbours say; record several realisations, or another period"
    )
    return told


def refuse_mispaired(frf: Frf, excited: Spectra, rough: np.ndarray | None) -> bool:
    """Refuse outputs that follow the input of another realisation, or turned round; warn of one that follows none.

    Their distortion and scatter would be those of random phases, and without detection lines nothing else tells.

    Parameters
    ----------
    frf : Frf
    excited : Spectra
        On the excited lines.
    rough : (F,) ndarray or None
        Variance of the FRF of one realisation about its neighbours, where it is known.

    Returns
    -------
    bool
        Whether it was warned of.

    Raises
    ------
    ValueError
        An output that follows the input of another realisation, not its own, or that has another sign than the others.
    """
    n = len(frf.each)
    spread = rough if n == 1 else n * (n - 1) * frf.var_total
    if spread is not None and np.add.reduce(spread) <= HIDDEN * power(frf.G):
        return False  # one that follows another input would scatter by more
    noise = frf.noise / np.maximum(squared_modulus(frf.each), TINY)
    return is_strange("y", excited.Y, "u", excited.U, noise, equal_steps(excited.where))


def refuse_another_reference(excited: Spectra) -> None:
    """The same of an input that follows the reference of another realisation, or none."""
    if excited.R is not None:
        noise = excited.var_U / np.maximum(excited.power_U, TINY)
        is_strange("u", excited.U, "r", excited.R, noise, equal_steps(excited.where))


def is_strange(answer: str, Y: np.ndarray, cause: str, U: np.ndarray, noise: np.ndarray, steps: np.ndarray) -> bool:
    """Whether an answer Y (M, F) was warned of that follows no cause U; refused where it is that of another.

    `noise` (M, F) is what Y / U has over its size squared, nan where it is not known.
    """
    n, n_steps = len(Y), steps.shape[1]
    if n_steps < FEWEST:
        return False
    chance = 1 / np.sqrt(2 * n_steps)
    each = unit(Y) * unit(U).conj()
    alone = np.add.reduce(second_steps(each, steps).real, axis=1) < UNRELATED * chance * n_steps
    if not alone.any():
        refuse_turned(answer, each)
        return False
    common = (second_steps(unit(Y), steps) @ second_steps(unit(U), steps).conj().T).real / n_steps
    sure = beyond_chance(n * n) * chance
    pairs = [(m, int(common[m].argmax())) for m in np.flatnonzero(alone) if common[m].max() > sure]
    if pairs:
        who = ", ".join(f"that of realisation {m} follows {cause} of realisation {other}" for m, other in pairs[:4])
        raise ValueError(
            f"{answer} must stand beside the {cause} that it answers, got {who}{', ...' if len(pairs) > 4 else ''}, by "
            "the phases of all lines: are the files of both in one order?"
        )
    quiet = ~(np.median(noise, axis=1) > NOISY)  # or nothing is known of it
    strange = np.flatnonzero(alone & quiet)
    told = strange.size > 0 and n_steps >= TELLING
    if told:
        who = ", ".join(map(str, strange[:6])) + (", ..." if strange.size > 6 else "")
        data_warning(
            f"{answer} does not follow {cause} in realisation {who}: from line to line its phase is random. Is it of "
            "another run, or all noise and distortion?"
        )
    return told


def refuse_turned(answer: str, each: np.ndarray) -> None:
    """Refuse phases (M, F) of another sign than those of the other realisations."""
    n, n_lines = each.shape
    agree = np.add.reduce((each * np.add.reduce(each).conj()).real, axis=1) - n_lines  # with the others
    turned = np.flatnonzero(agree < -beyond_chance(n) * np.sqrt((n - 1) * n_lines / 2))
    if n > 1 and turned.size:
        told = (
            "realisations 0 and 1 differ by it" if n == 2 else f"it turns in realisation {', '.join(map(str, turned))}"
        )
        raise ValueError(f"{answer} must have one sign, got: {told}; was it rewired, or is it half a turn late?")


def beyond_chance(n: int) -> float:
    """How many standard deviations the largest of n means of random phases stays under, but for `RELATED`.

    They have lighter tails than a normal distribution.
    """
    return float(np.sqrt(2 * np.log(n / RELATED)))


def unit(x: np.ndarray) -> np.ndarray:
    """Complex numbers of size one, with the phases of x; zero where x is."""
    return np.asarray(x / np.maximum(np.abs(x), TINY))


def second_steps(phases: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """(M, n) by how much phases (M, F) turn more over one step between lines than over the next equal one."""
    step = phases[:, 1:] * phases[:, :-1].conj()
    return np.asarray(step.take(steps[0], axis=1) * step.take(steps[1], axis=1).conj())
