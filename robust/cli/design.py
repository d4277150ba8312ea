"""The command `robust design`: a controller by H-infinity synthesis or with a fixed structure."""

from __future__ import annotations

import shlex
import warnings
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import nlfrf
import robust
from nlfrf._base.arguments import as_list, require_choice
from nlfrf._base.command import Json, finish_command, printer, spinner
from nlfrf._base.files import json_path
from robust._base.states import Stability
from robust.cli.options import LoopSampleTime, Out, require_demand

_PADE_ORDER = 4  # of the computation delay in the design of a continuous loop

#: Options of a fixed structure.
_Structure = Annotated[
    str, typer.Option(help="P, I, PI, PD, PID, lead, lead-lag or order-n (pid).")
]
_Positive = Annotated[
    bool,
    typer.Option("--positive", help="Keep Kp, Ki and Kd positive, as a PLC needs them (pid)."),
]
_FilterTime = Annotated[
    float | None,
    typer.Option(help="Time constant of the derivative filter [s]; default: chosen (pid)."),
]
_FixedFactor = Annotated[
    Path | None,
    typer.Option(
        help=(
            "Known factor of the controller: the [[filters]] of a .toml file, such as a notch,"
            " or a controller file (pid)."
        )
    ),
]
_PlantIntegrators = Annotated[
    int | None, typer.Option(help="Integrators of the plant; default: read from the FRF (pid).")
]
_PeakT = Annotated[float | None, typer.Option(help="Largest |T| allowed (pid).")]


def design(
    model: Annotated[
        Path,
        typer.Argument(help="Model from 'robust model'; for pid also a BLA from 'nlfrf identify'."),
    ],
    out: Out,
    bandwidth: Annotated[
        float | None,
        typer.Option(
            help=(
                "Wanted crossover [Hz] (ncfsyn; optional for pid), or bandwidth of S [Hz] (mixsyn)."
                " That of the loop "
                "is printed beside it."
            )
        ),
    ] = None,
    crossover_within: Annotated[
        float,
        typer.Option(
            help=(
                "Largest factor between the wanted crossover and that of the loop: a limit (pid) or"
                " a warning "
                "(ncfsyn). inf: any crossover above --bandwidth."
            )
        ),
    ] = 2.0,
    sample_time: LoopSampleTime = 0.0,
    delay: Annotated[float, typer.Option(help="Computation delay [s] to design for.")] = 0.0,
    factor: Annotated[
        float, typer.Option(help="gamma over the smallest possible gamma, above 1 (ncfsyn).")
    ] = 1.1,
    method: Annotated[
        str,
        typer.Option(
            help=(
                "ncfsyn: loop shaping; mixsyn: mixed sensitivity; pid: fixed structure from the"
                " FRF."
            )
        ),
    ] = "ncfsyn",
    structure: _Structure = "PID",
    positive_gains: _Positive = False,
    filter_time: _FilterTime = None,
    fixed: _FixedFactor = None,
    plant_integrators: _PlantIntegrators = None,
    peak: Annotated[float, typer.Option(help="Largest |S| allowed (mixsyn, pid).")] = 2.0,
    peak_t: _PeakT = None,
    error: Annotated[float, typer.Option(help="|S| allowed at zero frequency (mixsyn).")] = 1e-2,
    json: Json = False,
) -> None:
    """Design a controller by loop shaping (Glover & McFarlane), by mixed sensitivity, or with a
    fixed structure.

    Exit code 0: every limit is met. Exit code 1: not every limit is met; the best controller is
    written. Exit code 3: the FRF does not decide whether the loop is stable; the text names what
    would.
    """
    json_path(out)
    method = method.lower()
    require_choice("--method", method, ("ncfsyn", "mixsyn", "pid"))
    require_demand(bandwidth, error)
    from robust.io.pid import format_gains, reason_for_unusual_gains
    from robust.reports.command import describe_bandwidth, require_delay
    from robust.synthesis.hinf.design import describe_controller

    require_delay(delay, sample_time)
    if not crossover_within > 1:
        raise ValueError(f"--crossover-within must be a factor above 1, got {crossover_within:g}")
    _require_method_of_options(
        method,
        positive=positive_gains,
        filter_time=filter_time,
        fixed=fixed,
        peak_t=peak_t,
        plant_integrators=plant_integrators,
    )
    if method == "pid":
        plant, result, words, kept = _design_fixed_structure(
            model,
            structure,
            omega_c=(bandwidth, crossover_within),
            fixed=fixed,
            positive=positive_gains,
            M_S=peak,
            M_T=peak_t,
            dt=sample_time,
            delay=delay,
            filter_time=filter_time,
            plant_integrators=plant_integrators,
        )
    else:
        with spinner("designing"):
            plant, result = _synthesise(
                model, method, bandwidth, (peak, error, factor), dt=sample_time, delay=delay
            )
        words, kept = _describe_gamma(result), ""
        words += describe_bandwidth(
            plant, result.K, bandwidth, method, delay=delay, within=crossover_within
        )
    free = result.K if result.K_free is None else result.K_free
    if unusual := reason_for_unusual_gains(free):
        warnings.warn(unusual, robust.DesignWarning, stacklevel=2)
    unit = str(getattr(plant, "unit", ""))
    robust.save(result.K, out, delay=delay, unit=unit)
    say = printer(json)
    undecided = result.stability is Stability.UNDECIDED
    gains = format_gains(free, unit, plc=not undecided)
    say(f"{describe_controller(result.K)}: {words}{gains}{kept}")
    if method == "pid":
        say(_describe_next_steps(plant, result, structure, model, out, bandwidth))
    if method == "ncfsyn" and result.gamma > 4:
        say(
            "gamma above 4: the plant does not allow this shape of the loop; choose another"
            " --bandwidth"
        )
    short = method == "mixsyn" and result.gamma > 1
    if short:
        say("gamma above 1: demands and uncertainty cannot both be met; choose another --bandwidth")
    finish_command(result, result.met and not short, json, code=3 if undecided else 1)


def _require_method_of_options(method: str, **options: object) -> None:
    """Refuse an option of a fixed structure with another method."""
    for name, given in options.items():
        if given is not None and given is not False and method != "pid":
            option = name.replace("_", "-")
            raise ValueError(
                f"--{option} must be given with --method pid only, got it with {method}"
            )


def _design_fixed_structure(
    model: Path,
    structure: str,
    *,
    omega_c: tuple[float | None, float],
    fixed: Path | None,
    **limits: Any,
) -> tuple[nlfrf.Bla | robust.UncertaintyModel, robust.Design, str, str]:
    """Return the plant in a file, its controller, a text on both, and a text on the fixed factor.

    omega_c : crossover [Hz], and the factor that the crossover of the loop may be above it
    """
    from robust.io.models import load_model
    from robust.reports.command import crossover_limits, load_blas, load_fixed_factor

    plant: nlfrf.Bla | robust.UncertaintyModel
    if model.suffix.lower() == ".json":
        plant = load_model(model)
    else:
        [plant] = as_list(load_blas([model]))
    crossover = crossover_limits(plant, *omega_c)
    F, kept = 1, ""
    if fixed is not None:
        F, factor = load_fixed_factor(fixed)
        kept = f"\nfixed, behind it: {factor}"
    with spinner("designing"):
        result = robust.design_frf(plant, structure, omega_c=crossover, fixed=F, **limits)
    words = f"{result.limits_in_words}; {result.reason}"
    words += f"\n{result.loop_in_words}" if result.loop_in_words else ""
    return plant, result, words, kept


def _describe_gamma(result: robust.Design) -> str:
    certified = "" if result.certified else " (not certified)"
    return f"gamma {result.gamma:.3f}{certified}, at best {result.gamma_min:.3f}"


def _synthesise(
    model: Path,
    method: str,
    bandwidth: float | None,
    demands: tuple[float, float, float],
    *,
    dt: float,
    delay: float,
) -> tuple[robust.UncertaintyModel, robust.Design]:
    """Return the model in a file and its H-infinity controller for peak, error and factor."""
    if bandwidth is None:
        raise ValueError(f"--bandwidth must be given [Hz] for {method}")
    from robust.io.models import load_model
    from robust.lti.sampling import delayed

    plant, (peak, error, factor) = load_model(model), demands
    if delay and not plant.is_single and plant.nominal.dt:
        raise ValueError(
            f"--delay must be left out for several channels, got {delay:g} s: give it to robust"
            " model --delay"
        )
    if plant.measured_only:
        raise ValueError(
            f"model must have a parametric nominal for a design, got {model} with a measured FRF"
        )
    if method == "mixsyn":
        w_P = robust.performance_weight(2 * np.pi * bandwidth, M_S=peak, A=error)
        found = robust.mixsyn(plant, w_P, dt=dt, delay=delay)
    else:
        G = plant.nominal
        if dt and G.dt and abs(dt / G.dt - 1) > 1e-9:
            raise ValueError(f"--sample-time must be that of the model, {G.dt:g} s, got {dt:g} s")
        if dt and not G.dt:
            G = robust.sampled(G, dt, delay)
        else:
            G = delayed(G, delay, order=_PADE_ORDER)
        found = robust.ncfsyn(
            G, robust.shaping.crossover_weight(G, 2 * np.pi * bandwidth), factor=factor
        )
    if not found.met:
        raise ValueError(f"model must allow a controller, got none: {found.reason}")
    return plant, found


def _describe_next_steps(
    plant: nlfrf.Bla | robust.UncertaintyModel,
    result: robust.Design,
    structure: str,
    model: Path,
    out: Path,
    bandwidth: float | None,
) -> str:
    """Return text on a fixed structure: where its limits were tried, and what to do next."""
    if structure == "I":
        advice = ""
    else:
        from robust.io.pid import advice_on_structure

        free = result.K if result.K_free is None else result.K_free
        advice = advice_on_structure(free, plant.omega)
    tried = _describe_limit_checks(plant, model, between=result.met and not result.n_lines)
    if result.met:
        following = _describe_proof(plant, model, out, bandwidth)
    else:
        following = _advise_on_missed_limits(result, structure)
    return "\n".join(filter(None, (advice, tried, following)))


def _describe_limit_checks(
    plant: nlfrf.Bla | robust.UncertaintyModel, model: Path, *, between: bool
) -> str:
    """Return text on the place where the limits of a design were tried."""
    from robust.models.sets.measured import lines_of

    if lines_of(plant) is None:
        return (
            f"limits tried: on a grid, for every plant within the weight of {model}; a grid proves"
            " nothing"
        )
    first, last = plant.omega[[0, -1]] / (2 * np.pi)
    where = "lines and along the arcs between them" if between else "lines only"
    tried = (
        f"limits tried: on the {plant.omega.size} measured {where}, {first:.4g} to {last:.4g} Hz"
    )
    if isinstance(plant, nlfrf.Bla):
        return f"{tried}, each with its bound at 95 %; below and above nothing was measured"
    return f"{tried}, with the weight of {model} there"


def _describe_proof(
    plant: nlfrf.Bla | robust.UncertaintyModel, model: Path, out: Path, bandwidth: float | None
) -> str:
    """Return the command that proves more than a design did.

    A check uses the weight of a model, which covers every line and also holds outside the band. A
    limit that holds on the lines may fail there.
    """
    model_file, controller = shlex.quote(str(model)), shlex.quote(str(out))
    if not isinstance(plant, nlfrf.Bla):
        return f"prove it:    robust check {model_file} {controller}"
    made = shlex.quote(f"{model.stem}-model.json")
    if bandwidth:
        asked = f" --bandwidth {bandwidth:g}"
    else:
        asked = ""
    return (
        "a model has a weight that covers these bounds, so it may fail although the lines pass\n"
        f"prove it:    robust model {model_file}{asked} -o {made}; robust check {made} {controller}"
    )


def _advise_on_missed_limits(result: robust.Design, structure: str) -> str:
    """Return the options that help a fixed structure to meet its limits; empty if its stability is
    undecided, for which the reason of the design names the remedy.
    """
    if result.stability is Stability.UNDECIDED:
        return ""
    helps = ["a larger --peak", "a --structure of higher order, such as order-4"]
    if structure.startswith("order-"):
        helps[1] = "a higher order"
    if result.omega_c:
        helps.insert(0, "a lower --bandwidth")
    crossovers = () if result.loop is None else result.loop.crossovers
    if len(result.omega_c) == 2 and max(crossovers, default=0) > 0.98 * result.omega_c[1]:
        helps.append("--crossover-within inf, if a mode above the crossover may lift |L| above one")
    return f"to meet the limits: {'; or '.join(helps)}"
