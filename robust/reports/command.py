"""Files, pictures and reports of the command `robust`, for results with one or several channels."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import nlfrf
from nlfrf._base.arguments import (
    MissingArgumentError,
    as_list,
    inverse_unit,
    repeat_warnings,
    require_nonnegative,
    require_positive,
)
from nlfrf._base.command import spinner
from nlfrf._base.files import command_signature, require_file_of, write_text
from nlfrf._base.units import units_differ
from robust._base.channels import is_single
from robust._base.warnings import DesignWarning
from robust.analysis.loop_gains import loop_gains
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check
from robust.analysis.signals import LoopSignals, NoiseSignal, StepSignal
from robust.io.certificates import certificate_path, save_certificate, verify_certificate
from robust.io.models import has_own_states, load_bla, load_controller_context, load_model
from robust.io.models import load_controller as load_stored_controller
from robust.io.pid import format_gains
from robust.lti.sampling import discretize
from robust.models.fit.given_weights import performance_weight
from robust.models.fit.nominal import fit_nominal
from robust.models.fit.nominal_fit import NominalFit
from robust.models.fit.search import UNLIKELY_COST
from robust.models.sets.model import UncertaintyModel, has_several_channels
from robust.models.sets.orders import describe_order, scan_orders
from robust.synthesis.pid_file import load_pid

if TYPE_CHECKING:
    import control

_BLA_SUFFIXES = (".npz", ".h5", ".hdf5")
# a longer delay is probably in ms; each sample of it is a state of the plant
_MAX_DELAY_SAMPLES = 50
Pictures = list[tuple[Callable[..., object], object]]


def load_blas(
    paths: Sequence[Path],
    *,
    relative_std: float | None = None,
    n_averages: float | None = None,
    channel: str = "",
    columns: str = "",
) -> nlfrf.Bla | list[nlfrf.Bla]:
    """Return the BLA or matrix of a file, with its warnings repeated, or the FRF of another
    program; several as a list.

    All files must have the same number of channels: one, or several.
    """
    found: list[nlfrf.Bla] = []
    for path in paths:
        own = path.suffix.lower() in _BLA_SUFFIXES
        if own and (relative_std is not None or n_averages is not None or channel or columns):
            raise ValueError(
                "relative_std, n_averages, channel and columns must be left out for a BLA, got"
                f" them with {path}"
            )
        if not own:
            require_file_of(path, "nlfrf-bla")
        if own:
            one = repeat_warnings(load_bla(path))
        else:
            one = _read_frf(
                path,
                relative_std=relative_std,
                n_averages=n_averages,
                channel=channel,
                columns=columns,
            )
        found.append(one)
        if len({is_single(bla) for bla in found}) > 1:
            raise ValueError(
                f"bla must be all BLAs or all matrices, got {path} with {type(one).__name__}"
            )
    if len(found) == 1:
        return found[0]
    return found


def _read_frf(
    path: Path, *, relative_std: float | None, n_averages: float | None, channel: str, columns: str
) -> nlfrf.Bla:
    """Return an FRF of another program; without a variance the error has the command that makes a
    BLA of it.
    """
    try:
        return nlfrf.io.load_frf(
            path, relative_std=relative_std, n_averages=n_averages, channel=channel, columns=columns
        )
    except MissingArgumentError as error:
        option = {"relative_std": "--relative-std STD", "n_averages": "--averages N"}[
            error.parameter
        ]
        way = f"nlfrf frf {path.name} {option} -o bla.npz makes a BLA of it for every command"
        raise ValueError(f"{error}; {way}") from None


def with_units_of(record: nlfrf.Record, blas: Sequence[nlfrf.Bla]) -> nlfrf.Record:
    """Return a record, with the units of the first BLA with these channels if it has none."""
    same = [bla for bla in blas if (bla.inputs, bla.outputs) == (record.inputs, record.outputs)]
    if not same or any(record.input_units + record.output_units):
        return record
    return replace(record, input_units=same[0].input_units, output_units=same[0].output_units)


def fit_nominal_model(
    blas: nlfrf.Bla | list[nlfrf.Bla],
    *,
    n_poles: int | None,
    n_zeros: int | None,
    delay: float | str | None,
    dt: float,
    stable: bool,
    bandwidth: float | None,
) -> tuple[NominalFit, str]:
    """Return the nominal model and a text on its order; an order that is not given is chosen for
    the loop or the data.

    bandwidth : crossover [Hz] of the loop for which the order is chosen; without it the data
    decide.
    """
    if n_poles is None and n_zeros is not None:
        raise ValueError(f"poles must be given with zeros, got {n_zeros} zeros alone")
    if bandwidth is None:
        omega_c = None
    else:
        omega_c = 2 * np.pi * require_positive("bandwidth", bandwidth)
    levels = as_list(blas)
    if n_poles is None and (omega_c is not None or len(levels) == 1):
        scan = scan_orders(
            blas, delay="auto" if delay is None else delay, dt=dt, stable=stable, omega_c=omega_c
        )
        if omega_c is not None:
            return repeat_warnings(scan.fit), f"{scan}"
        order = f"order: the data need {describe_order(scan.fit)}; robust orders lists the others"
        order += ", and no order explains the data" if scan.fit.p_value < UNLIKELY_COST else ""
        return repeat_warnings(scan.fit), order
    if n_poles is None:
        # the largest order that a single level needs: the misfit of one model to all levels needs
        # no more poles
        scans = [
            scan_orders(level, delay="auto" if delay is None else delay, dt=dt, stable=stable)
            for level in levels
        ]
        best = max((scan.fit for scan in scans), key=lambda fit: fit.G.nstates)
        if delay is not None:
            tau = delay
        elif best.delay:
            tau = "estimate"
        else:
            tau = 0.0
        fit = fit_nominal(blas, n_poles=best.G.nstates, delay=tau, dt=dt, stable=stable)
        return (
            fit,
            (
                f"order: one of {len(levels)} records needs {describe_order(best)}, none needs more"
                " poles"
            ),
        )
    fit = fit_nominal(
        blas,
        n_poles=n_poles,
        n_zeros=n_zeros,
        delay=delay or 0.0,
        dt=dt,
        stable=stable,
        omega_c=omega_c,
    )
    if (
        len(levels) > 1 or not fit.p_value < UNLIKELY_COST
    ):  # one model for several levels leaves more
        return fit, ""
    best = scan_orders(levels[0], dt=dt, stable=stable, omega_c=omega_c).fit
    left = (
        f"order: {describe_order(fit)} leave a misfit of {fit.cost / fit.expected_cost:.3g} times"
        " noise and distortion, which widens the set"
    )
    asked = "the data need" if omega_c is None else "enough for the loop:"
    return fit, left + (
        f"; {asked} {describe_order(best)}" if best.G.nstates != fit.G.nstates else ""
    )


def load_controller(path: Path) -> tuple[control.StateSpace, float | None, str]:
    """Return a controller, its computation delay [s] and the unit of its plant; None and "" if the
    file has none.
    """
    if path.suffix.lower() == ".toml":
        settings = load_pid(path)
        return settings.K, settings.delay, inverse_unit(settings.unit) if settings.unit else ""
    return load_stored_controller(path), *load_controller_context(path)


def format_gains_of(path: Path, K: control.StateSpace, unit: str) -> str:
    """Return the gains of a PID as text, with the filters from a TOML file; empty for another
    controller.
    """
    if path.suffix.lower() != ".toml":
        return format_gains(K, unit)
    settings = load_pid(path)
    if settings.filters:
        filters = f"\nPID behind it: {', '.join(map(str, settings.filters))}"
    else:
        filters = ""
    return format_gains(settings.pid.system(settings.dt), unit) + filters


def load_fixed_factor(path: Path) -> tuple[control.StateSpace, str]:
    """Return a factor of a controller that a design keeps, and its description: the filters of a
    PID in a TOML file, or a whole controller.
    """
    if path.suffix.lower() != ".toml":
        return load_stored_controller(path), f"the controller of {path}"
    settings = load_pid(path)
    if not settings.filters:
        raise ValueError(
            f"fixed must have [[filters]], got {path} without: its PID is designed anew, and only"
            " filters are kept"
        )
    F = settings.filters[0].system(settings.dt)
    for one in settings.filters[1:]:
        F = F * one.system(settings.dt)
    return F, f"{', '.join(map(str, settings.filters))}, of {path}"


def load_loops(
    paths: Sequence[Path], given: float | None, unit: str = ""
) -> list[tuple[control.StateSpace, float]]:
    """Return each controller with its computation delay [s], as given or from its file.

    A controller for a plant in another unit is refused, if both units are known.
    """
    loops = []
    for path in paths:
        K, stored, unit_of_plant = load_controller(path)
        is_typed = path.suffix.lower() == ".toml"
        if units_differ(unit, unit_of_plant):
            raise ValueError(
                f"controller must be for a plant in {unit}, the unit of the model, got {path} for"
                f" {unit_of_plant}" + f": Kp must be in {inverse_unit(unit)}" * is_typed
            )
        if is_typed and unit and not unit_of_plant:
            warnings.warn(
                f"{path} has no unit for Kp: {inverse_unit(unit)} is assumed, because the model is"
                f" in {unit}",
                DesignWarning,
                stacklevel=2,
            )
        if K.dt and stored is None and given is None:
            warnings.warn(
                f"{path} has no computation delay: zero is assumed. Give --delay [s]"
                + ", or delay to robust.save" * (path.suffix.lower() == ".json"),
                DesignWarning,
                stacklevel=2,
            )
        if given is None:
            delay = stored or 0.0
        else:
            delay = require_delay(given, K.dt)
        if stored is not None and abs(delay - stored) > 1e-9:
            warnings.warn(
                f"{path} was designed for a computation delay of {stored:g} s, but --delay is"
                f" {delay:g} s: the result holds for {delay:g} s. Leave --delay out to use the"
                " delay of the file",
                DesignWarning,
                stacklevel=2,
            )
        loops.append((K, delay))
    return loops


def require_delay(delay: float, dt: float) -> float:
    """Return a computation delay [s]; refuse one that is so long for the sampling time [s] that it
    must be in ms.
    """
    require_nonnegative("delay", delay)
    if dt and delay > _MAX_DELAY_SAMPLES * dt:
        raise ValueError(
            f"delay must be in seconds, and at most {_MAX_DELAY_SAMPLES} sampling periods of {dt:g}"
            f" s, got {delay:g} s, which is {delay / dt:.4g} periods; for {delay:g} ms give --delay"
            f" {delay / 1e3:g}"
        )
    return delay


def require_own_states(paths: Sequence[Path]) -> None:
    """Refuse the controllers of a schedule if one was saved as a transfer function: the states of
    different realisations do not mean the same. A PID in a TOML file has the states of its parts.
    """
    for path in paths:
        if path.suffix.lower() != ".toml" and not has_own_states(path):
            raise ValueError(
                "controller must be matrices whose states mean the same at every operating point,"
                f" got {path}, which was saved as a transfer function: give matrices to"
                " control.ss, and save that"
            )


def load_single_model(path: Path) -> UncertaintyModel:
    """Return the model in a file; refuse one with several inputs or outputs."""
    model = load_model(path)
    if has_several_channels(model):
        raise ValueError(
            f"model must have one input and output for this command, got {path} with"
            f" {model.n_outputs} outputs by {model.n_inputs} inputs; robust check and robust export"
            " accept it"
        )
    return model


def demand_weight(
    model: UncertaintyModel, bandwidth: float | None, peak: float, error: float
) -> control.StateSpace | None:
    """Return the performance weight for a bandwidth [Hz], sampled for a sampled matrix; None
    without a bandwidth.
    """
    if bandwidth is None:
        return None
    w_P = performance_weight(2 * np.pi * bandwidth, M_S=peak, A=error)
    if has_several_channels(model) and model.nominal.dt:
        return discretize(w_P, model.nominal.dt)
    return w_P


def crossover_limits(
    plant: nlfrf.Bla | UncertaintyModel, bandwidth: float | None, within: float
) -> float | tuple[float, float] | None:
    """Return limits of the crossover [rad/s] for a bandwidth [Hz]: from it to `within` times it, if
    there are lines.
    """
    if bandwidth is None:
        return None
    least, most = 2 * np.pi * bandwidth, 2 * np.pi * bandwidth * within
    if most <= plant.omega[-1]:
        return least, most
    return least


def describe_bandwidth(
    model: UncertaintyModel,
    K: control.StateSpace,
    asked: float | None,
    method: str,
    *,
    delay: float,
    within: float,
) -> str:
    """Return the wanted and the actual crossovers or bandwidth of S [Hz] as text; empty for several
    channels.

    It warns if every crossover misses the wanted one by more than the factor `within`. A mode may
    add crossovers.
    """
    if not model.is_single or asked is None:
        return ""
    seen = check(model, K, delay=delay, certify=False).classical
    if method == "mixsyn":
        got = seen.bandwidth / (2 * np.pi)
        return (
            f"; bandwidth of S {f'{got:.4g} Hz' if np.isfinite(got) else 'none'}, asked"
            f" {asked:.4g} Hz"
        )
    crossovers = np.array(seen.crossovers) / (2 * np.pi)
    name = "crossover" if crossovers.size <= 1 else "crossovers"
    text = (
        f"{name} {', '.join(f'{got:.4g} Hz' for got in crossovers) or 'none'}, asked {asked:.4g} Hz"
    )
    if not np.any((asked / within <= crossovers) & (crossovers <= asked * within)):
        warnings.warn(
            f"{text}: off by more than a factor of {within:g} (--crossover-within). The plant"
            " does not allow this shape of the loop; choose another --bandwidth",
            DesignWarning,
            stacklevel=2,
        )
    return f"; {text}"


def signals_from_options(
    step: float | None, disturbance: float | None, noise: float | None, up_to: float | None
) -> LoopSignals | None:
    """Return the signals for the level of the loop: height of a step, two rms, end of a band [Hz];
    None without any.
    """
    if up_to is None:
        end = float("inf")
    else:
        end = 2 * np.pi * require_positive("up-to", up_to)
    if step is None:
        reference = None
    else:
        reference = StepSignal(step)
    disturbance_noise, measurement_noise = (
        None if rms is None else NoiseSignal(require_nonnegative(name, rms), omega_max=end)
        for name, rms in (("disturbance", disturbance), ("noise", noise))
    )
    if reference is None and disturbance_noise is None and measurement_noise is None:
        return None
    return LoopSignals(reference=reference, disturbance=disturbance_noise, noise=measurement_noise)


def model_pictures(model: UncertaintyModel, blas: nlfrf.Bla | Sequence[nlfrf.Bla]) -> Pictures:
    """Return the pictures of `robust model`."""
    from robust import plot

    return [(plot.plot_weight, model), (lambda one, ax: plot.plot_set(one, blas, ax=ax), model)]


def check_pictures(
    model: UncertaintyModel, K: control.StateSpace, report: RobustnessReport
) -> Pictures:
    """Return the pictures of `robust check`."""
    from robust import plot

    if has_several_channels(model):
        gains = loop_gains(model.nominal, K, omega=model.omega)
        return [(plot.plot_loop, gains), (plot.plot_check, report)]
    return [(plot.plot_loop, report), (plot.plot_check, report)]


def write_report_files(report: RobustnessReport, out: Path, say: Callable[[object], None]) -> None:
    """Write a report, and its certificate beside it, which is verified at once."""
    write_text(out, f"{report}\n\n{command_signature('robust check')}\n")
    handed = certificate_path(out)
    if any(
        certificate.holds and certificate.claim is not None
        for certificate in report.proofs.certificates
    ):
        save_certificate(report, handed)
        with spinner("verifying"):
            say(replace(verify_certificate(handed), warnings=()))  # the report has shown them
    elif handed.exists():
        say(f"{handed} is from an earlier run: this run has no certificate to write")
