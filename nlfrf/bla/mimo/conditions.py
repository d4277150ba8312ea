"""What a set of experiments has to be for its matrix to mean what is said: independent inputs, independent phases."""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import TINY, power, rms
from nlfrf.bla.calibration import LARGEST, read_peaks, variance_ratio
from nlfrf.bla.mimo.channels import ChannelSpectra, nearest_places
from nlfrf.bla.realizations import refuse_strangers, warn_of_low_peaks
from nlfrf.records.record import Record
from nlfrf.signals.crest import have_low_crest, is_improbable
from nlfrf.signals.lines import LineGrid

__all__ = ["calibrated", "check_experiments", "independent_experiments", "is_zippered", "read_inputs", "warn_of_loud"]


LOOSE, LOST = 10.0, 1e6  # condition of the inputs: warned of, refused
COPIED = 0.9  # |mean over lines of exp(j difference)|: 1 for copies, about F^-1/2 for independent phases
NOISY = 0.3  # power of the noise on an input over its own: bounds hold up to there, at 1 G is off by a third
LOUD = 1.3  # covariance of one experiment over the mean of all, above which the law of the matrix is off
ROUNDING = 1e-12  # of |Y|: scatter below it is none
APART = 0.03  # amplitude beside that of the owner below which a line counts as zippered


def known_inputs(spectra: ChannelSpectra) -> np.ndarray:
    """(n_u, M, F) what was played, as well as it is known: the references, else the inputs."""
    return (spectra.U if spectra.R is None else spectra.R)[..., spectra.excited]


def is_zippered(spectra: ChannelSpectra) -> bool:
    """Whether each line drives one input only."""
    size = np.sqrt(np.mean(np.abs(known_inputs(spectra)) ** 2, axis=1))
    size = np.sort(size / size.max(axis=1, keepdims=True), axis=0)
    return len(size) > 1 and bool(np.mean(size[-2] < APART * size[-1]) > 0.95)


def check_experiments(record: Record, spectra: ChannelSpectra) -> None:
    """Refuse inputs that cannot be told apart, and warn of a set whose phases are copies."""
    n_u, M = record.n_inputs, spectra.U.shape[1]
    if is_zippered(spectra):
        if record.r is not None:
            raise ValueError("r must be left out for a zippered record, which is for open loop, got references")
        data_warning(
            "each line drives one input (zippered): every column was fitted between its own lines, with poles that all "
            "entries share; how their scatter reaches it is in the bound, what a local model of two poles cannot "
            "follow is not"
        )
        refuse_other_sets(np.abs(known_inputs(spectra)) ** 2, record.inputs, zippered=True)
        return
    refuse_silent(record, spectra)
    if M % n_u:
        raise ValueError(
            f"record must hold n_inputs = {n_u} experiments a set, or a whole number of sets, got {M}. "
            "A zippered multisine needs one experiment only."
        )
    power = np.abs(known_inputs(spectra)) ** 2
    refuse_other_sets(power.reshape(n_u, -1, n_u, power.shape[2]).mean(axis=2), record.inputs)
    warn_of_noisy_inputs(record, spectra)
    if warned_of_condition(spectra):  # inputs that are nearly the same have the same phases, too
        return
    Z = known_inputs(spectra)
    if n_u > 1 and spectra.excited.size > 5:
        if copies(Z).any():
            data_warning(
                "inputs of an experiment have the same phases (phi): the BLA of u1^2 u2 would read 3 sigma^2 "
                "instead of sigma^2; give each input phases of its own, as multisine(n_inputs=) does"
            )
        if independent_experiments(spectra) < M:
            data_warning(
                "experiments have the same phases (psi): their distortion is the same but for signs, so its covariance "
                "is not the one assumed, up to 1.8 times as large in some entries, and the detection lines of the "
                "experiments are copies, counted once; give each experiment phases of its own, as multisine(n_inputs=) "
                "does"
            )


def read_inputs(record: Record, spectra: ChannelSpectra) -> float:
    """How much more random phases distort than those at hand (`read_peaks`), on average over the inputs.

    Warns of the first input whose peaks are lower than random phases have them.
    """
    played, lines, told = record.u if record.r is None else record.r, spectra.lines[spectra.excited], []
    for u, U, name in zip(played[:, :, 0], known_inputs(spectra), record.inputs, strict=True):
        U = U[are_on(power(U))]
        size = rms(U)
        own = size > APART * size.max()
        peaks = warn_of_low_peaks(u[are_on(u.var(axis=1))], size[own], lines[own], name)
        told.append(read_peaks(U[:, own], lines[own], have_low_crest(peaks))[0])
        if is_improbable(peaks):
            break
    return float(np.mean(told))


def are_on(size: np.ndarray) -> np.ndarray:
    """(M,) in which experiments an input was played, by its powers (M,)."""
    return np.asarray(size > APART**2 * size.max())


def refuse_other_sets(power: np.ndarray, names: tuple[str, ...], zippered: bool = False) -> None:
    """Refuse sets that were played louder or softer than the others, by the powers (n, R, F) of their inputs."""
    if power.shape[1] > 1:
        total = power.sum(axis=1)
        owner = (total / total.max(axis=1, keepdims=True)).argmax(axis=0) if zippered else None
        for i, (one, name) in enumerate(zip(power, names, strict=True)):
            refuse_strangers(one if owner is None else one[:, owner == i], f"set of {name}", first_number=1)


def refuse_silent(record: Record, spectra: ChannelSpectra) -> None:
    """Refuse an excited line that no experiment of a set drives through some input."""
    U = spectra.U[..., spectra.excited]
    power = np.sqrt(np.mean(np.abs(U) ** 2, axis=1))
    silent = power <= 1e-9 * power.max(axis=1, keepdims=True)
    if silent.any():
        i, k = np.argwhere(silent)[0]
        line = int(spectra.lines[spectra.excited[k]])
        raise ValueError(
            f"lines must be excited by every input, got line {line} with no input on it in {record.inputs[i]}"
        )


def warned_of_condition(spectra: ChannelSpectra) -> bool:
    """Refuse inputs that cannot be told apart, warn of those that nearly depend on each other: noise grows by it."""
    U = spectra.U[..., spectra.excited]
    n_u, _M, F = U.shape
    one = U.reshape(n_u, -1, n_u, F).transpose(1, 3, 0, 2)
    scaled = one / rms(np.moveaxis(U, 1, 0)).T[:, :, None]  # each input over its size on the line: it may be shaped
    sizes = np.linalg.svd(scaled, compute_uv=False)
    condition = sizes[..., 0] / np.maximum(sizes[..., -1], 1e-300)
    worst = float(condition.max())
    where = int(spectra.lines[spectra.excited[int(condition.max(axis=0).argmax())]])
    if worst > LOST:
        raise ValueError(
            f"u must hold experiments that tell the inputs apart, got a condition of {worst:.2g} at line {where}. "
            "Are two experiments the same?"
        )
    if worst > LOOSE:
        data_warning(
            f"the experiments tell the inputs apart badly: condition {worst:.3g} at line {where}, "
            f"{float(np.median(condition)):.3g} in the median; errors of G grow by it, unless a mixing "
            "for the weak direction of the plant was meant"
        )
    return worst > LOOSE


def copies(Z: np.ndarray) -> np.ndarray:
    """(M, n, n) bool, which channels of (n, M, F) have the same phases but for a constant, in each experiment."""
    phase = Z / np.maximum(np.abs(Z), 1e-300)
    like = np.abs(np.einsum("imf,jmf->mij", phase, phase.conj())) / Z.shape[2]
    return np.asarray((like > COPIED) & ~np.eye(len(Z), dtype=bool))


def independent_experiments(spectra: ChannelSpectra) -> int:
    """How many experiments have phases of their own in every input."""
    Z = known_inputs(spectra)
    if Z.shape[2] < 6:
        return Z.shape[1]
    alike = np.all(copies(np.swapaxes(Z, 0, 1)), axis=0, keepdims=True)[0]  # (M, M)
    first = [m for m in range(len(alike)) if not alike[m, :m].any()]
    return len(first)


def calibrated(grid: LineGrid, n_detection: int) -> bool:
    """Whether odd detection lines tell the level within a known factor on this grid."""
    if grid.odd.size < n_detection or grid.kind in ("full", "odd", "odd-odd"):
        return False
    if grid.kind in ("special-odd", "random-odd"):
        return True
    if np.any(grid.excited % 2 == 0):
        return False
    near = nearest_places(grid, "odd", n_detection)
    ratio = variance_ratio(np.ones((1, grid.excited.size)), grid.excited, grid.odd, near)
    return bool(np.mean(ratio <= LARGEST) >= 0.95)


def warn_of_noisy_inputs(record: Record, spectra: ChannelSpectra) -> None:
    """Warn of inputs that are lost in their noise on some lines, where no references over several sets average it."""
    at = spectra.excited
    power = np.sum(np.abs(spectra.U[..., at]) ** 2, axis=1)
    noise = np.sum(np.abs(spectra.dU[..., at]) ** 2, axis=(1, 2)) / np.maximum(power, TINY)
    lost = noise > NOISY
    if (spectra.R is None or spectra.U.shape[1] == record.n_inputs) and lost.any():
        i, k = np.unravel_index(int(noise.argmax()), noise.shape)
        data_warning(
            f"{record.inputs[i]} is lost in its noise on {lost.any(axis=0).sum()} of {at.size} lines, worst at line "
            f"{spectra.lines[at[k]]}, where it scatters by {100 * np.sqrt(noise[i, k]):.0f} % of its size: G reads too "
            "low there. Record more periods, or several sets with what was played as references r"
        )


def warn_of_loud(spectra: ChannelSpectra, cov_total: np.ndarray) -> None:
    """Warn of an experiment that was disturbed: bounds take all of a set to scatter alike.

    Its own scatter takes the place of the mean one in the covariance (n_y, n_y, F) by everything. Entries are hardly
    moved, as every experiment goes into every entry; the largest singular value is, as the error has rank one.
    """
    at = spectra.excited
    noise = np.sum(np.abs(spectra.dY[..., at]) ** 2, axis=2)  # (n_y, M, F)
    size = np.mean(np.abs(spectra.Y[..., at]) ** 2, axis=1)
    mean = noise.mean(axis=1)
    if noise.shape[1] < 2 or not np.any(mean > ROUNDING**2 * size):
        return
    floor = ROUNDING**2 * size + TINY
    share = np.median(np.minimum(mean / (np.einsum("jjk->jk", cov_total).real + floor), 1.0), axis=1)
    own = np.mean((noise + floor[:, None]) / (mean + floor)[:, None], axis=2)  # (n_y, M), one in the mean
    louder = np.max(1 + share[:, None] * (own - 1), axis=0)
    if louder.max() > LOUD + 2 / np.sqrt(at.size * spectra.n_free):
        worst = int(louder.argmax())
        others = np.delete(noise, worst, axis=1).mean(axis=1)
        times = float(np.sqrt((noise[:, worst].mean(axis=1) / np.maximum(others.mean(axis=1), 1e-300)).max()))
        data_warning(
            f"experiment {worst + 1} of {noise.shape[1]} scatters {times:.1f} times as much from period to period as "
            "the others; was it disturbed? Measure it again: the bound of the whole matrix takes them to be alike "
            "(where one was ten times as noisy 58 to 87 % was measured instead of 95 %, 92 to 95 % of the entries)"
        )
