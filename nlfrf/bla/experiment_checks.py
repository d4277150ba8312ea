"""Checks of experiments with several inputs: every line excited, equal amplitude spectra,
independent phases.

The checks are made before the estimation, because its result does not show these faults.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import TINY, mean_power, power, rms, squared_modulus
from nlfrf.bla.calibration import crest_correction
from nlfrf.bla.realizations import join_repeats, require_equal_spectra, warn_of_low_crest
from nlfrf.bla.spectra import Spectra
from nlfrf.records.excited_lines import check_lines
from nlfrf.records.record import Record
from nlfrf.signals.crest import have_low_crest, is_improbable

_MIN_LINE_POWER = 1e-18  # least power of an input on a line, over its largest
#: Power over that of its noise below which an input is lost, and the largest share of such lines.
_MIN_POWER_OVER_NOISE, _MAX_LOST_SHARE = 4.0, 0.1
_FEW_PHASE_LINES = 5  # lines up to which phases cannot be compared
# condition number of the inputs: limit of a warning, of a refusal
_HIGH_CONDITION = 10.0
_MAX_CONDITION = 1e6
# |mean over lines of exp(j difference)|: 1 for copies, about F^-1/2 for independent phases
_MIN_COPY_COHERENCE = 0.9
# power of the noise on an input over its own up to which bounds hold; at 1 G is off by a third
_MAX_INPUT_NOISE = 0.3
#: Covariance of one experiment over the mean of all, above which the law of the matrix is wrong.
_MAX_EXPERIMENT_NOISE = 1.3
_SCATTER_ROUNDING = 1e-12  # share of |Y| below which scatter is rounding
#: Amplitude over the largest below which an input is not played on a line, or in an experiment.
_MIN_PLAYED_AMPLITUDE = 0.03


class _CrestCorrection(NamedTuple):
    """Correction of the distortion level for the crest factor of the inputs; see
    `crest_correction`.
    """

    # distortion_ratio, coherent_share: as in `crest_correction`; means over the inputs
    distortion_ratio: float
    coherent_share: float
    has_low_crest: bool  # True if an input has a lower crest factor than usual


def check_experiments(
    record: Record, spectra: Spectra
) -> tuple[Spectra, Spectra, _CrestCorrection]:
    """Check that the experiments determine a matrix, and merge those that repeat another one.

    Returns
    -------
    The spectra, with a repeated experiment as further periods of the first; the same on the excited
    lines alone; and the correction for the crest factor.

    Warns
    -----
    DataWarning
        Experiments with the phases of another one; inputs with the phases of another input; inputs
        that are nearly dependent, or lost in their noise; a reference with lines that the input
        does not have; peaks lower than those of random phases.
    """
    single, n_u = record.is_single, record.n_inputs
    excited = spectra.select_excited()
    played = record.u if record.r is None else record.r
    played = played.reshape(n_u, *played.shape[-3:])
    if n_u == 1:
        check_lines(
            played[0],
            excited.lines,
            excited.mean_power_U[0] if excited.R is None else mean_power(excited.R[0]),
        )
    if not excited.is_zippered:
        _require_excited_lines(record, excited)
    elif record.r is not None:
        raise ValueError(
            "r must be left out for a zippered record (each line excites one input), which is"
            " for open loop, got references"
        )
    if excited.experiments_per_set == 1:
        _require_equal_sets(record, excited)
    before = excited
    spectra, distinct = join_repeats(
        spectra, excited, *(("realisation", 0) if single else ("experiment", 1))
    )
    if len(distinct) < excited.U.shape[1]:
        excited, played = spectra.select_excited(), played[:, distinct]
    if excited.experiments_per_set > 1:
        if excited.U.shape[1] % n_u:
            raise ValueError(
                f"record must hold {n_u} experiments for its {n_u} inputs, or a multiple of"
                f" {n_u}, got {excited.U.shape[1]}. A zippered multisine needs one experiment"
                " only."
            )
        _require_equal_sets(record, excited)
        _warn_of_noisy_inputs(record, excited)
        if not _warn_of_dependent_inputs(excited):  # nearly equal inputs also have equal phases
            _warn_of_copies(excited)
    elif excited.is_zippered:
        data_warning(
            "each line excites one input (zippered), so each column of G was interpolated"
            " between its own lines, by a local model with two poles. The bound contains the"
            " scatter of these lines, but not the error of this model where G is less smooth"
        )
    elif before.R is not None:
        _warn_of_lost_input(before)
    return (
        spectra,
        excited,
        _correct_for_crest(record, before, excited=excited, played=played[:, :, 0]),
    )


def _correct_for_crest(
    record: Record, before: Spectra, *, excited: Spectra, played: np.ndarray
) -> _CrestCorrection:
    """Return the correction for the crest factor, averaged over the inputs as played (n_u, M, N).

    Warns of an input whose crest factor is lower than that of random phases. Inputs after one with
    improbable peaks are left out. `before` has the spectra before repeated realisations were
    joined.
    """
    corrections, any_low, lines = [], False, excited.lines
    names = record.inputs
    for u, U, known, name in zip(played, excited.U, before.excitation, names, strict=True):
        size, own = before.amplitude if before.R is None else rms(known), slice(None)
        if len(names) > 1:  # the experiments in which this input was played
            known = known[_played_experiments(known)]
            size, u, U = rms(known), u[_played_experiments(U)], U[_played_experiments(U)]
        if excited.is_zippered:
            own = size > _MIN_PLAYED_AMPLITUDE * size.max()
        peaks = warn_of_low_crest(u, size[own], lines=lines[own], name=name)
        low = have_low_crest(peaks)
        corrections.append(crest_correction(U[:, own], lines[own], low))
        any_low |= low
        if is_improbable(peaks):
            break
    ratio, coherent_share = (sum(one) / len(corrections) for one in zip(*corrections, strict=True))
    return _CrestCorrection(
        distortion_ratio=ratio, coherent_share=coherent_share, has_low_crest=any_low
    )


def _played_experiments(U: np.ndarray) -> np.ndarray:
    """Return an (M,) mask of the experiments in which an input U (M, F) was played."""
    size = power(U)
    return np.asarray(size > _MIN_PLAYED_AMPLITUDE**2 * size.max())


def _require_equal_sets(record: Record, excited: Spectra) -> None:
    """Refuse sets whose input power differs from that of the other sets."""
    if excited.U.shape[1] == excited.experiments_per_set:
        return
    if excited.R is None:
        power = excited.power_U
    else:
        power = squared_modulus(excited.R)
    power = (
        np.add.reduce(
            power.reshape(len(power), -1, excited.experiments_per_set, power.shape[2]), axis=2
        )
        / excited.experiments_per_set
    )
    if record.is_single:
        require_equal_spectra(power[0])
        return
    total = power.sum(axis=1)
    owner = (total / total.max(axis=1, keepdims=True)).argmax(axis=0)
    for i, (one, name) in enumerate(zip(power, record.inputs, strict=True)):
        if excited.is_zippered:
            own = one[:, owner == i]
        else:
            own = one
        require_equal_spectra(own, f"set of {name}", first_number=1)


def _require_excited_lines(record: Record, excited: Spectra) -> None:
    """Refuse lines without input, where G would be 0 / 0, or without reference, whose phase would
    be chance.
    """
    for side, spectrum in (("input", excited.U), ("reference", excited.R)):
        if spectrum is None:
            continue
        # for several inputs some experiment has to drive a line
        if side == "input":
            power = excited.power_U
        else:
            power = squared_modulus(spectrum)
        if excited.experiments_per_set != 1:
            power = np.mean(power, axis=1, keepdims=True)
        faintest = _MIN_LINE_POWER * power.max(axis=(1, 2), keepdims=True)
        if (power <= faintest).any():
            i, _, k = np.argwhere(power <= faintest)[0]
            if record.is_single:
                every, there = "the", ""
            else:
                every, there = "every", f" in {record.inputs[i]}"
            raise ValueError(
                f"lines must be excited by {every} {side}, got line {excited.lines[k]} with no"
                f" {side} on it{there}"
            )


def _warn_of_lost_input(excited: Spectra) -> None:
    """Warn of lines of a reference on which the only input, over all realisations, is within its
    noise.
    """
    R = excited.excitation[0]
    U = np.add.reduce(excited.U[0] * (R.conj() / np.abs(R)))
    if excited.dU.shape[2]:
        noise = np.add.reduce(squared_modulus(excited.dU[0]), axis=(0, 1))
    else:
        noise = np.nan
    lost = np.count_nonzero(squared_modulus(U) < _MIN_POWER_OVER_NOISE * noise)
    if lost > _MAX_LOST_SHARE * U.size:
        data_warning(
            f"u is not above its noise on {lost} of the {U.size} lines of r, so G is a ratio of"
            " noises there. Is r the signal that was played in this record?"
        )


def _warn_of_copies(excited: Spectra) -> None:
    """Warn of inputs, or experiments, that have the phases of one another."""
    if excited.lines.size <= _FEW_PHASE_LINES:
        return
    if _find_phase_copies(excited.excitation).any():
        data_warning(
            "inputs of an experiment have the same phases (phi). Products of inputs then bias"
            " the BLA: for u1^2 u2 it would be 3 sigma^2 instead of sigma^2. Give each input"
            " phases of its own, as multisine(n_inputs=) does"
        )
    if count_independent_experiments(excited) < excited.U.shape[1]:
        data_warning(
            "experiments have the same phases (psi), so their distortion is equal up to signs."
            " The covariance of some entries may be 1.8 times as large as stated, and the"
            " detection lines of all experiments count as one. Give each experiment phases of"
            " its own, as multisine(n_inputs=) does"
        )


def _warn_of_dependent_inputs(excited: Spectra) -> bool:
    """Refuse linearly dependent inputs; warn of ill-conditioned ones, which amplify noise, and
    return True.
    """
    U = excited.U
    n_u, _M, F = U.shape
    one = U.reshape(n_u, -1, n_u, F).transpose(1, 3, 0, 2)
    scaled = one / rms(np.moveaxis(U, 1, 0)).T[:, :, None]  # each input over its size on the line
    sizes = np.linalg.svd(scaled, compute_uv=False)
    condition = sizes[..., 0] / np.maximum(sizes[..., -1], 1e-300)
    worst = float(condition.max())
    line = int(excited.lines[int(condition.max(axis=0).argmax())])
    if worst > _MAX_CONDITION:
        raise ValueError(
            "u must hold experiments that separate the inputs, got a condition number of"
            f" {worst:.2g} at line {line}. Are two experiments the same?"
        )
    if worst > _HIGH_CONDITION:
        data_warning(
            f"the experiments separate the inputs badly: the condition number is {worst:.3g} at"
            f" line {line}, {float(np.median(condition)):.3g} in the median. Errors of G grow in"
            " proportion. Ignore this if you mixed the inputs on purpose, to excite the weak"
            " direction of the plant"
        )
    return worst > _HIGH_CONDITION


def _find_phase_copies(Z: np.ndarray) -> np.ndarray:
    """Return (M, n, n) bool, the pairs of channels of Z (n, M, F) with equal phases up to a
    constant.
    """
    phase = Z / np.maximum(np.abs(Z), 1e-300)
    like = np.abs(np.einsum("imf,jmf->mij", phase, phase.conj())) / Z.shape[2]
    return np.asarray((like > _MIN_COPY_COHERENCE) & ~np.eye(len(Z), dtype=bool))


def count_independent_experiments(excited: Spectra) -> int:
    """Count the experiments that have phases of their own in every input."""
    Z = excited.excitation
    if len(Z) == 1 or Z.shape[2] <= _FEW_PHASE_LINES:
        return Z.shape[1]
    same_phases = np.all(_find_phase_copies(np.swapaxes(Z, 0, 1)), axis=0)  # (M, M)
    return sum(not same_phases[m, :m].any() for m in range(len(same_phases)))


def _warn_of_noisy_inputs(record: Record, excited: Spectra) -> None:
    """Warn of inputs below their noise on some lines, unless references over several sets average
    it.
    """
    noise = np.sum(squared_modulus(excited.dU), axis=(1, 2)) / np.maximum(
        np.sum(excited.power_U, axis=1), TINY
    )
    lost = noise > _MAX_INPUT_NOISE
    if (excited.R is None or excited.U.shape[1] == record.n_inputs) and lost.any():
        i, k = np.unravel_index(int(noise.argmax()), noise.shape)
        data_warning(
            f"{record.inputs[i]} is lost in its noise on {lost.any(axis=0).sum()} of"
            f" {noise.shape[1]} lines: at line {excited.lines[k]} its standard deviation is"
            f" {100 * np.sqrt(noise[i, k]):.0f} % of its amplitude. G is too small there. Record"
            " more periods, or several sets of experiments, and give the played signals as"
            " references r"
        )


def warn_of_noisy_experiment(excited: Spectra, cov_total: np.ndarray) -> None:
    """Warn of an experiment that scatters more than the others: the bound assumes equal scatter
    within a set.

    The test replaces the mean scatter in the total covariance (n_y, n_y, F) by that of one
    experiment. Bounds of single entries hardly change, because every experiment contributes to
    every entry. The largest singular value changes, because the error has rank one.
    """
    noise = np.sum(squared_modulus(excited.dY), axis=2)  # (n_y, M, F)
    size = np.mean(squared_modulus(excited.Y), axis=1)
    mean = noise.mean(axis=1)
    if noise.shape[1] < 2 or not np.any(mean > _SCATTER_ROUNDING**2 * size):
        return
    floor = _SCATTER_ROUNDING**2 * size + TINY
    share = np.median(
        np.minimum(mean / (np.einsum("jjk->jk", cov_total).real + floor), 1.0), axis=1
    )
    own = np.mean(
        (noise + floor[:, None]) / (mean + floor)[:, None], axis=2
    )  # (n_y, M), one in the mean
    louder = np.max(1 + share[:, None] * (own - 1), axis=0)
    if louder.max() > _MAX_EXPERIMENT_NOISE + 2 / np.sqrt(size.shape[1] * (excited.n_periods - 1)):
        worst = int(louder.argmax())
        others = np.delete(noise, worst, axis=1).mean(axis=1)
        times = float(
            np.sqrt((noise[:, worst].mean(axis=1) / np.maximum(others.mean(axis=1), TINY)).max())
        )
        data_warning(
            f"experiment {worst + 1} of {noise.shape[1]} scatters {times:.1f} times as much"
            " from period to period as the others. The bound assumes equal scatter: with one"
            " experiment ten times as noisy the bound of the whole matrix held for 58 to 87 %"
            " instead of 95 %. Was the experiment disturbed? Measure it again"
        )
