"""The command ``robust``: files in, files out."""

from __future__ import annotations

import shlex
import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import lazy_loader
import numpy as np
import typer

import nlfrf
import robust
from nlfrf._base.arguments import require_choice, require_positive
from nlfrf._base.axes import write_pictures
from nlfrf._base.command import (
    Commands,
    Json,
    Version,
    finish_command,
    parse_number,
    printer,
    run_command,
    spinner,
)
from nlfrf._base.files import (
    LOAD_OPTIONS,
    command_signature,
    json_path,
    require_file_of,
    require_writable,
    write_text,
)
from robust._base.options import (
    Discard,
    Period,
    PlayedDesign,
    Reference,
    Resample,
    SamplingFrequency,
)
from robust._base.states import FrictionVerdict, Stability
from robust.servo.cli import servo_app

#: Imported when a command uses them, so that help and refusals of the command line are fast.
(
    certificates,
    learnings,
    models,
    measured,
    pid,
    sampling,
    from_options,
    to_prove,
    prover,
    shaping_page,
) = (
    lazy_loader.load(
        f"robust.{module}", suppress_warning=True
    )  # their packages are lazy themselves
    for module in (
        "io.certificates",
        "io.learning",
        "io.models",
        "models.sets.measured",
        "io.pid",
        "lti.sampling",
        "reports.command",
        "reports.prove",
        "friction.proof.prove",
        "reports.shaping_page.command",
    )
)

app = Commands(
    help="Uncertainty models of measured machines, controllers for them, and checks with proofs.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # units stand in brackets
)

#: Parameters of the library whose options have other names.
_OPTIONS = LOAD_OPTIONS | {
    "n_poles": "poles",
    "n_zeros": "zeros",
    "dt": "sample-time",
    "M_S": "peak",
    "M_T": "peak-t",
    "filter_time": "filter-time",
    "omega_c": "bandwidth",
    "relative_std": "relative-std",
    "n_averages": "averages",
    "channel": "channel",
    "columns": "columns",
    "Fs": "force",
    "omega_Q": "cutoff",
    "u_max": "limit",
    "base_velocity": "velocity",
    "n_levels": "ramp",
    "n_periods": "periods",
    "n_realizations": "realizations",
    "max_candidates": "candidates",
    "f_min": "f-min",
    "f_max": "f-max",
}


class _DesignByDefault(typer.core.TyperGroup):
    """Commands with `design` as the default."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `design` in front of arguments without a command."""
        return super().parse_args(
            ctx, args if not args or args[0] in (*self.commands, "--help") else ["design", *args]
        )


learn_app = Commands(
    help="Learn the input of a repeated trial.",
    cls=_DesignByDefault,
    no_args_is_help=True,
)
app.add_typer(servo_app, name="servo")
app.add_typer(learn_app, name="learn")
_CONTROLLER_FILES = (
    "from 'robust design', matrices saved by MATLAB (.mat), or a PID with notches (.toml)"
)
_PADE_ORDER = 4  # of the computation delay in the design of a continuous loop
Out = Annotated[Path, typer.Option("--out", "-o", help="File to write (.json).")]
Delay = Annotated[
    float | None, typer.Option(help="Computation delay [s]; default: that of the controller file.")
]
Picture = Annotated[Path | None, typer.Option(help="Picture to write (.png, .pdf, .svg).")]
#: Signals that act on a loop, from which its level is predicted.
StepHeight = Annotated[
    float | None,
    typer.Option("--reference-step", help="Level of the loop: height of a step of the reference."),
]
DisturbanceRms = Annotated[
    float | None,
    typer.Option("--disturbance", help="Level of the loop: rms of white noise at the plant input."),
]
NoiseRms = Annotated[
    float | None,
    typer.Option("--noise", help="Level of the loop: rms of white noise of the sensor."),
]
NoiseBand = Annotated[
    float | None,
    typer.Option(
        "--up-to",
        help=(
            "Level of the loop: highest frequency of the noise [Hz]; needed for a continuous loop."
        ),
    ),
]


@app.callback()
def common(version: Version = False) -> None:
    """Uncertainty models of measured machines, controllers for them, and checks with proofs."""


@app.command()
def model(
    bla: Annotated[
        list[Path],
        typer.Argument(
            help=(
                "BLA or matrix from 'nlfrf identify', or an FRF (see 'nlfrf inspect'); several make"
                " a family."
            )
        ),
    ],
    out: Out,
    poles: Annotated[
        int | None,
        typer.Option(
            help=(
                "Poles of the nominal model; default: as few as the loop of --bandwidth needs,"
                " without --bandwidth as "
                "many as the data need."
            )
        ),
    ] = None,
    zeros: Annotated[
        int | None, typer.Option(help="Zeros of the nominal model; default: one fewer than poles.")
    ] = None,
    delay: Annotated[
        str | None,
        typer.Option(
            help=(
                "Delay [s] of the nominal model, or 'estimate'; default: none with --poles, else"
                " from the phase."
            )
        ),
    ] = None,
    bandwidth: Annotated[
        float | None,
        typer.Option(
            help=(
                "Crossover [Hz] of the loop for which fit and order are chosen; default: the whole"
                " band."
            )
        ),
    ] = None,
    sample_time: Annotated[
        float, typer.Option(help="Sampling time [s] of a discrete model; 0 for continuous.")
    ] = 0.0,
    unstable: Annotated[bool, typer.Option("--unstable", help="Allow unstable poles.")] = False,
    form: Annotated[
        str | None,
        typer.Option(
            help=(
                "multiplicative (default), additive, inverse-..., coprime; for a matrix elements,"
                " additive, input."
            )
        ),
    ] = None,
    order: Annotated[
        int | None,
        typer.Option(help="Order of the weight; default: chosen, up to 12."),
    ] = None,
    confidence: Annotated[
        float, typer.Option(help="Probability that the set contains a line of another realisation.")
    ] = 0.95,
    simultaneous: Annotated[
        bool, typer.Option("--simultaneous", help="This probability for all lines together.")
    ] = False,
    no_even: Annotated[
        bool, typer.Option("--no-even", help="Leave out the even distortion.")
    ] = False,
    systematic: Annotated[
        float | None,
        typer.Option(help="Systematic part of the distortion [dB above the odd level]."),
    ] = None,
    below: Annotated[
        str, typer.Option(help="Radius below the band: 'flat', or its slope [dB/decade].")
    ] = "flat",
    above: Annotated[
        str, typer.Option(help="Radius above the band: 'flat', or its slope [dB/decade].")
    ] = "20",
    perturbation: Annotated[
        str, typer.Option(help="Class of the perturbations: statistical, LTI or operator.")
    ] = "statistical",
    relative_std: Annotated[
        float | None,
        typer.Option(help="For an FRF: standard deviation over |G|, from repeated sweeps."),
    ] = None,
    averages: Annotated[
        float | None,
        typer.Option(
            help="For an FRF: number of independent averages behind the coherence, or of sweeps."
        ),
    ] = None,
    channel: Annotated[
        str, typer.Option(help="Name of the FRF in a file with several, such as CH2.")
    ] = "",
    columns: Annotated[
        str,
        typer.Option(
            help=(
                "For an FRF: its columns, 'f=col1 [Hz], re=col2 [Ohm], im=-col3 [Ohm]', or mag=,"
                " phase=."
            )
        ),
    ] = "",
    picture: Picture = None,
) -> None:
    """Fit a nominal model to a measured BLA or FRF, and a weight to its uncertainty."""
    json_path(out)
    blas = from_options.load_blas(
        bla, relative_std=relative_std, n_averages=averages, channel=channel, columns=columns
    )
    tau = delay if delay in (None, "estimate") else parse_number("delay", delay)
    with spinner("fitting the nominal model"):
        nominal, words = from_options.fit_nominal_model(
            blas,
            n_poles=poles,
            n_zeros=zeros,
            delay=tau,
            dt=sample_time,
            stable=not unstable,
            bandwidth=bandwidth,
        )
    print(nominal)
    if words:
        print(words)
    with spinner("fitting the weight"):
        result = robust.uncertainty(
            blas,
            nominal,
            form=form,
            order=order,
            confidence=confidence,
            simultaneous=simultaneous,
            even=not no_even,
            systematic=systematic,
            below=below if below == "flat" else parse_number("below", below),
            above=above if above == "flat" else parse_number("above", above),
            perturbation=perturbation,
        )
    print(result)
    robust.save(result, out)
    if picture is not None:
        write_pictures(picture, from_options.model_pictures(result, blas))


@app.command()
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
    sample_time: Annotated[
        float, typer.Option(help="Sampling time [s] of the controller; 0 for continuous.")
    ] = 0.0,
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
    structure: Annotated[
        str, typer.Option(help="P, I, PI, PD, PID, lead, lead-lag or order-n (pid).")
    ] = "PID",
    positive_gains: Annotated[
        bool,
        typer.Option("--positive", help="Keep Kp, Ki and Kd positive, as a PLC needs them (pid)."),
    ] = False,
    filter_time: Annotated[
        float | None,
        typer.Option(help="Time constant of the derivative filter [s]; default: chosen (pid)."),
    ] = None,
    fixed: Annotated[
        Path | None,
        typer.Option(
            help=(
                "Known factor of the controller: the [[filters]] of a .toml file, such as a notch,"
                " or a controller file (pid)."
            )
        ),
    ] = None,
    plant_integrators: Annotated[
        int | None, typer.Option(help="Integrators of the plant; default: read from the FRF (pid).")
    ] = None,
    peak: Annotated[float, typer.Option(help="Largest |S| allowed (mixsyn, pid).")] = 2.0,
    peak_t: Annotated[float | None, typer.Option(help="Largest |T| allowed (pid).")] = None,
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
    _require_demand(bandwidth, error)
    from_options.require_delay(delay, sample_time)
    if not crossover_within > 1:
        raise ValueError(f"--crossover-within must be a factor above 1, got {crossover_within:g}")
    for option, given in (
        ("positive", positive_gains),
        ("filter-time", filter_time),
        ("fixed", fixed),
        ("peak-t", peak_t),
        ("plant-integrators", plant_integrators),
    ):
        if given is not None and given is not False and method != "pid":
            raise ValueError(
                f"--{option} must be given with --method pid only, got it with {method}"
            )
    result: robust.Design
    factor_text = ""
    if method == "pid":
        if model.suffix.lower() == ".json":
            plant = models.load_model(model)
        else:
            plant = from_options.load_blas([model])
        omega_c = from_options.crossover_limits(plant, bandwidth, crossover_within)
        F = None
        if fixed is not None:
            F, kept = from_options.load_fixed_factor(fixed)
            factor_text = f"\nfixed, behind it: {kept}"
        with spinner("designing"):
            result = robust.design_frf(
                plant,
                structure,
                positive=positive_gains,
                M_S=peak,
                M_T=peak_t,
                omega_c=omega_c,
                dt=sample_time,
                delay=delay,
                filter_time=filter_time,
                fixed=1 if F is None else F,
                plant_integrators=plant_integrators,
            )
        words = f"{result.limits_in_words}; {result.reason}"
        words += f"\n{result.loop_in_words}" if result.loop_in_words else ""
    else:
        with spinner("designing"):
            plant, result = _synthesise(
                model, method, bandwidth, (peak, error, factor), dt=sample_time, delay=delay
            )
        words = (
            f"gamma {result.gamma:.3f}{'' if result.certified else ' (not certified)'}, at best"
            f" {result.gamma_min:.3f}"
        )
        words += from_options.describe_bandwidth(
            plant, result.K, bandwidth, method, delay=delay, within=crossover_within
        )
    free = result.K if result.K_free is None else result.K_free
    if unusual := pid.reason_for_unusual_gains(free):
        warnings.warn(unusual, robust.DesignWarning, stacklevel=2)
    unit = str(getattr(measured.origin_of(plant), "unit", ""))
    robust.save(result.K, out, delay=delay, unit=unit)
    if result.K.dt:
        kind = f"sampled at {1 / result.K.dt:g} Hz"
    else:
        kind = "continuous"
    say = printer(json)
    undecided = result.stability is Stability.UNDECIDED
    gains = pid.format_gains(free, unit, plc=not undecided)
    say(f"controller of order {result.K.nstates}, {kind}: {words}{gains}{factor_text}")
    if method == "pid":
        if structure == "I":
            advice = ""
        else:
            advice = pid.advice_on_structure(free, plant.omega)
        tried = _describe_limit_checks(plant, model, between=result.met and not result.n_lines)
        if result.met:
            following = _describe_proof(plant, model, out, bandwidth)
        else:
            following = _advise_on_missed_limits(result, structure)
        say("\n".join(filter(None, (advice, tried, following))))
    if method == "ncfsyn" and result.gamma > 4:
        say(
            "gamma above 4: the plant does not allow this shape of the loop; choose another"
            " --bandwidth"
        )
    short = method == "mixsyn" and result.gamma > 1
    if short:
        say("gamma above 1: demands and uncertainty cannot both be met; choose another --bandwidth")
    finish_command(result, result.met and not short, json, code=3 if undecided else 1)


@app.command()
def check(
    model: Annotated[Path, typer.Argument(help="Model from 'robust model'.")],
    controller: Annotated[list[Path], typer.Argument(help=f"Controllers: {_CONTROLLER_FILES}.")],
    delay: Delay = None,
    bandwidth: Annotated[
        float | None, typer.Option(help="Performance: required bandwidth of S [Hz].")
    ] = None,
    peak: Annotated[
        float,
        typer.Option(
            help="Largest |S| over the set without a warning; with --bandwidth it is required."
        ),
    ] = 2.0,
    error: Annotated[
        float, typer.Option(help="Performance: largest |S| at zero frequency.")
    ] = 1e-2,
    no_certify: Annotated[
        bool, typer.Option("--no-certify", help="Check on a grid only, without proof.")
    ] = False,
    proof: Annotated[
        str,
        typer.Option(
            help=(
                "Proof of a single loop: exact, lmi (a matrix from cvxpy, verified exactly) or"
                " both."
            )
        ),
    ] = "exact",
    solver: Annotated[
        str | None,
        typer.Option(help="CLARABEL or SCS, for --proof lmi and several channels; default: both."),
    ] = None,
    reference_step: StepHeight = None,
    disturbance: DisturbanceRms = None,
    noise: NoiseRms = None,
    up_to: NoiseBand = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Report to write (.txt), with its certificate beside it."),
    ] = None,
    picture: Picture = None,
    json: Json = False,
) -> None:
    """Check controllers against a model: nominal stability, the whole set, and a proof over all
    frequencies.

    Exit code 0: every loop is proved stable with the whole set, and the demand, if there is one, is
    met. Exit code 1: not so. A warning of thin margins, |S| above --peak over the set, does not
    change the exit code. With several controllers each has its own files: report.txt becomes
    report-CONTROLLER.txt.
    """
    _require_demand(bandwidth, error)
    if len({path.stem for path in controller}) < len(controller):
        raise ValueError(
            f"controller must be files of different names, got {', '.join(map(str, controller))}"
        )
    several = len(controller) > 1
    files = {
        path: [_controller_file(path, one, several) for one in (out, picture)]
        for path in controller
    }
    require_writable(*(one for pair in files.values() for one in pair if one is not None))
    require_writable(
        *(
            certificates.certificate_path(report)
            for report, _ in files.values()
            if report is not None
        )
    )
    plant, say, reports = models.load_model(model), printer(json), {}
    w_P = from_options.demand_weight(plant, bandwidth, peak, error)
    signals = from_options.signals_from_options(reference_step, disturbance, noise, up_to)
    for path, (K, late) in zip(
        controller, from_options.load_loops(controller, delay, plant.origin.unit), strict=True
    ):
        with spinner("checking"):
            report = robust.check(
                plant,
                K,
                w_P=w_P,
                delay=late,
                certify=not no_certify,
                proof=proof,  # type: ignore[arg-type]
                solver=solver,
                signals=signals,
            )
        report = replace(report, peak=require_positive("peak", peak))
        gains = from_options.format_gains_of(path, K, plant.origin.unit)
        say(f"{path}:\n{report}{gains}\n" if several else f"{report}{gains}")
        text, drawing = files[path]
        if text is not None:
            from_options.write_report_files(report, text, say)
        if drawing is not None:
            write_pictures(drawing, from_options.check_pictures(plant, K, report))
        reports[str(path)] = report
    good = all(
        r.proofs.robustly_stable and (r.proofs.robust_performance or w_P is None)
        for r in reports.values()
    )
    finish_command(reports, good, json)


@app.command()
def verify(
    file: Annotated[
        Path,
        typer.Argument(
            help="Certificate from 'robust check' or 'robust prove' (.certificate.json)."
        ),
    ],
    model: Annotated[
        Path | None, typer.Option(help="Model that must be the one in the certificate.")
    ] = None,
    controller: Annotated[
        Path | None, typer.Option(help="Controller that must be the one in the certificate.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="Processor time [s] after which the rest counts as not verified.")
    ] = 60.0,
    json: Json = False,
) -> None:
    """Prove a certificate again, with all rounding outward (exit code 1: a claim is not proved)."""
    if model is None:
        plant = None
    else:
        plant = models.load_model(model)
    if controller is None:
        K = None
    else:
        K = from_options.load_controller(controller)[0]
    with spinner("verifying"):
        found = robust.io.verify_certificate(file, model=plant, K=K, time_cap=seconds)
    printer(json)(f"{found}\n{'VERIFIED' if found.verified else 'NOT VERIFIED'}")
    finish_command(found, found.verified, json)


@app.command()
def prove(
    machine: Annotated[
        list[Path],
        typer.Argument(
            help="Model from 'robust model', or BLAs or records at three levels or more."
        ),
    ],
    controller: Annotated[Path, typer.Argument(help=f"Controller: {_CONTROLLER_FILES}.")],
    stiffness: Annotated[
        float | None,
        typer.Option(
            help="Presliding stiffness of the friction [N/m]; default: read from the levels."
        ),
    ] = None,
    nominal: Annotated[
        Path | None,
        typer.Option(
            help="With BLAs: model of one level, for a machine that is flexible or has a delay."
        ),
    ] = None,
    free: Annotated[
        bool, typer.Option("--free", help="With records: the machine has no spring to ground.")
    ] = False,
    masses: Annotated[
        int,
        typer.Option(help="2: with records, a motor and a load, which takes up to half a minute."),
    ] = 1,
    stiction: Annotated[float, typer.Option(help="Largest over smallest force of a slider.")] = 1.5,
    delay: Delay = None,
    force: Annotated[
        float | None,
        typer.Option(
            help=(
                "Largest friction force [N], for a bound of the hunting or a kick that"
                " destabilises."
            )
        ),
    ] = None,
    input: Annotated[
        str | None, typer.Option("--input", help="Name of the force in traces; default: u.")
    ] = None,
    output: Annotated[
        str | None, typer.Option("--output", help="Name of the position in traces; default: y.")
    ] = None,
    reference: Reference = None,
    fs: SamplingFrequency = None,
    period: Period = None,
    discard: Discard = 0,
    resample: Resample = False,
    design: PlayedDesign = None,
    hold: Annotated[
        str | None, typer.Option(help="Force between its samples: zoh or band-limited.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Result to write (.txt), with its certificates beside it."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Prove that a machine comes to rest with every friction of a class, or find a friction with
    which it does not.

    Exit code 0: proved for every machine. Exit code 1: not proved.
    """
    if out is not None:
        require_writable(*(certificates.certificate_path(out, number) for number in range(2)))
    [(K, late)] = from_options.load_loops([controller], delay)
    named = {
        "u": input,
        "y": output,
        "r": reference,
        "fs": fs,
        "n_samples": period,
        "design": design,
        "hold": hold,
    }
    named |= {"n_discard": discard or None, "resample": resample or None}
    load = {name: option for name, option in named.items() if option is not None}
    given = to_prove.MachineFiles(
        files=tuple(machine),
        controller=controller,
        nominal=nominal,
        stiffness=stiffness,
        stiction=stiction,
        free=free,
        masses=masses,
        load=load,
    )
    basis = to_prove.read_basis(given)
    with spinner("proving"):
        proofs = prover.prove_all(basis.machines, K, basis.friction, delay=late, Fs=force)
    text = f"{basis}\n" + "\n\n".join(map(str, proofs))
    say = printer(json)
    say(text)
    if out is not None:
        write_text(out, f"{text}\n\n{command_signature('robust prove')}\n")
        to_prove.save_proofs(proofs, out, basis)
    finish_command(proofs, all(proof.verdict is FrictionVerdict.PROVED for proof in proofs), json)


@app.command("prove-schedule")
def prove_schedule(
    bla: Annotated[
        list[Path], typer.Argument(help="BLAs of 'nlfrf identify', one at each operating point.")
    ],
    controller: Annotated[
        list[Path],
        typer.Option(help="Controller at each operating point in one realisation; or one for all."),
    ],
    at: Annotated[str, typer.Option(help="Operating points, increasing: -0.2,0,0.2")],
    rate: Annotated[
        float, typer.Option(help="Largest rate of the operating point, per second; inf: it jumps.")
    ],
    poles: Annotated[int, typer.Option(help="Number of poles at each operating point.")],
    degree: Annotated[int, typer.Option(help="Degree of the polynomials of the plant.")] = 2,
    form: Annotated[
        str | None, typer.Option(help="Form of the set, as of one input: multiplicative (default).")
    ] = None,
    order: Annotated[int | None, typer.Option(help="Order of the weight.")] = None,
    gain: Annotated[str, typer.Option(help="S or GS: prove its gain too.")] = "",
    level: Annotated[float | None, typer.Option(help="Level of that gain.")] = None,
    over: Annotated[str, typer.Option(help="Name of the operating point.")] = "position",
    unit: Annotated[str, typer.Option(help="Its unit.")] = "m",
    delay: Delay = None,
    limit: Annotated[
        bool, typer.Option(help="Search the largest provable rate, and one that breaks it.")
    ] = True,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Certificate to write (.json).")
    ] = None,
    json: Json = False,
) -> None:
    """Prove that a scheduled loop stays stable while its operating point moves; exit code 0 where
    it is proved.
    """
    points = [parse_number("--at", part) for part in at.split(",")]
    loops = from_options.load_loops(controller, delay)
    dt, late = float(loops[0][0].dt or 0.0), loops[0][1]
    delays = sorted({one for _, one in loops})
    if len(delays) > 1:
        raise ValueError(
            "controller must have one computation delay at all operating points, got"
            f" {delays[0]:g} and {delays[-1]:g} s: give --delay"
        )
    named: dict[str, Any] = {"at": points, "over": over, "unit": unit} | (
        {} if form is None else {"form": form}
    )
    blas = [models.load_bla(path) for path in bla]
    with spinner("fitting"):
        plant = robust.models.interpolate(
            blas, n_poles=poles, degree=degree, dt=dt, order=order, **named
        )
    if len(loops) == 1:
        K = loops[0][0]
    else:
        K = robust.models.LpvModel.from_points([K for K, _ in loops], **named)
    with spinner("proving"):
        proof = robust.prove_schedule(
            plant, K, rate=rate, delay=late, gain=gain, level=level, limit=limit
        )
    printer(json)(f"{plant}\n{proof}")
    if out is not None and proof.holds:
        robust.save(proof, out)
    finish_command(proof, proof.holds, json)


@learn_app.command("design")
def design_learning(
    model: Annotated[Path, typer.Argument(help="Model from 'robust model'.")],
    controller: Annotated[Path, typer.Argument(help="Sampled controller that stays in the loop.")],
    out: Out,
    factor: Annotated[
        float, typer.Option(help="Largest factor per trial, for every plant of the set.")
    ] = 0.8,
    cutoff: Annotated[
        float | None,
        typer.Option(help="Cut-off of Q [Hz]; default: the highest in the band with this factor."),
    ] = None,
    limit: Annotated[float, typer.Option(help="Largest learned |u|, in the unit of u.")] = np.inf,
    delay: Delay = None,
    picture: Picture = None,
) -> None:
    """Design a learning filter for a loop with repeated trials (the word design may be left
    out).
    """
    plant = models.load_model(model)
    [(K, late)] = from_options.load_loops([controller], delay, plant.origin.unit)
    if cutoff is None:
        omega_Q = None
    else:
        omega_Q = 2 * np.pi * require_positive("--cutoff", cutoff)
    with spinner("designing and proving"):
        learning = robust.design_learning(
            plant, K, factor=factor, omega_Q=omega_Q, delay=late, u_max=limit
        )
    print(learning)
    robust.save(learning, out)
    if picture is not None:
        from robust.plot import plot_contraction

        write_pictures(picture, [(plot_contraction, learning)])


@learn_app.command("step")
def step_learning(
    learning: Annotated[Path, typer.Argument(help="Filter from 'robust learn'.")],
    u: Annotated[Path, typer.Argument(help="Added input of the trial: the last column of a .csv.")],
    e: Annotated[Path, typer.Argument(help="Error r - y of the trial: the last column of a .csv.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="File for the input of the next trial (.csv).")
    ],
) -> None:
    """Compute the input of the next trial from input and error of the last trial, sampled like the
    controller.
    """
    filters = learnings.load_learning(learning)
    found = filters.update(from_options.read_last_column(u), from_options.read_last_column(e))
    rows = [f"{k * filters.dt:.12g},{sample!r}" for k, sample in enumerate(found.tolist())]
    write_text(out, "\n".join(["t [s],learned input", *rows]) + "\n")
    print(f"{found.size} samples, at most {np.abs(found).max():.4g}")


@app.command()
def orders(
    bla: Annotated[
        list[Path], typer.Argument(help="BLA from 'nlfrf identify'; several make a plant family.")
    ],
    most: Annotated[int, typer.Option(help="Largest number of poles to try.")] = 8,
    relative_degree: Annotated[
        int | None, typer.Option(help="Poles minus zeros; default: 1, or a likelier number.")
    ] = None,
    delay: Annotated[
        str, typer.Option(help="Delay [s], 'estimate', or 'auto': if the phase shows one.")
    ] = "auto",
    bandwidth: Annotated[
        float | None, typer.Option(help="Crossover [Hz] of the loop for which the order is chosen.")
    ] = None,
    sample_time: Annotated[
        float, typer.Option(help="Sampling time [s] of discrete models; 0 for continuous.")
    ] = 0.0,
    picture: Picture = None,
) -> None:
    """Fit nominal models of growing order, and choose the one that a loop or the data need."""
    with spinner("fitting nominal models"):
        scan = robust.models.scan_orders(
            from_options.load_blas(bla),
            n_poles=range(relative_degree or 1, most + 1),
            relative_degree=relative_degree,
            delay=delay if delay in ("estimate", "auto") else parse_number("delay", delay),
            dt=sample_time,
            omega_c=(
                None if bandwidth is None else 2 * np.pi * require_positive("bandwidth", bandwidth)
            ),
        )
    print(scan)
    if picture is not None:
        from robust.plot import plot_fit, plot_orders

        write_pictures(picture, [(plot_orders, scan), (plot_fit, scan.fit)])


@app.command()
def export(
    file: Annotated[
        Path,
        typer.Argument(
            help=(
                "Model, controller or certificate from 'robust check --proof lmi' (.json), or a PID"
                " (.toml)."
            )
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            help=(
                "File to write: .mat (with a loader .m), .py (python-control), .csv (sections), .h"
                " (C), .st (PLC)."
            ),
        ),
    ],
    dtype: Annotated[
        str | None,
        typer.Option(help="Code: float32 (default in C) or float64 (default in structured text)."),
    ] = None,
    limit: Annotated[
        list[float] | None,
        typer.Option(help="Code: largest |u|; given twice: smallest and largest u."),
    ] = None,
    rounded: Annotated[
        Path | None,
        typer.Option(
            help=(
                "Code: file for the controller with rounded coefficients, to check it again"
                " (.json)."
            )
        ),
    ] = None,
) -> None:
    """Write a model or controller for MATLAB (.mat), a model for python-control (.py), or a
    controller as code.

    Code of a sampled controller is C (.h), structured text (.st), or second-order sections (.csv).
    """
    is_code = out.suffix in (".h", ".st")
    if not is_code and (dtype or limit or rounded):
        raise ValueError(
            f"--dtype, --limit and --rounded must be left out except for .h and .st, got {out}"
        )
    if is_code:
        K, late, unit = from_options.load_controller(file)
        write = robust.io.export_c if out.suffix == ".h" else robust.io.export_structured_text
        if dtype:
            given = {"dtype": dtype}
        else:
            given = {}
        if rounded:
            require_writable(rounded)
        code = write(K, out, limit=limit or None, unit=unit, **given)
        if rounded:
            models.save_controller(code.K, rounded, delay=late, unit=unit)
        print(code)
    elif out.suffix == ".mat":
        require_file_of(
            file,
            "robust-model",
            "robust-matrix-model",
            "robust-controller",
            "robust-mu-certificate",
        )
        robust.io.export_matlab(robust.load(file), out)
    elif out.suffix == ".py":
        robust.io.export_python(models.load_model(file), out)
    elif out.suffix == ".csv":
        sections = robust.io.controller_sections(from_options.load_controller(file)[0])
        if isinstance(sections, tuple):
            raise ValueError(
                f"file must be a controller with one input and output for .csv, got {len(sections)}"
                f" channels in {file}"
            )
        rows = [",".join(map(repr, row)) for row in sections.tolist()]
        write_text(out, "\n".join(["b0,b1,b2,a0,a1,a2", *rows]) + "\n")
    else:
        raise ValueError(f"out must end in .mat, .csv, .h, .st or .py, got {out}")


@app.command()
def reduce(
    model: Annotated[Path, typer.Argument(help="Model from 'robust model'.")],
    controller: Annotated[Path, typer.Argument(help=f"Controller: {_CONTROLLER_FILES}.")],
    out: Out,
    order: Annotated[
        int | None, typer.Option(help="Order to reach; default: the lowest that keeps all proofs.")
    ] = None,
    delay: Delay = None,
    bandwidth: Annotated[
        float | None, typer.Option(help="Performance: required bandwidth of S [Hz].")
    ] = None,
    peak: Annotated[float, typer.Option(help="Performance: largest allowed |S|.")] = 2.0,
    error: Annotated[
        float, typer.Option(help="Performance: largest |S| at zero frequency.")
    ] = 1e-2,
    candidates: Annotated[int, typer.Option(help="Number of reduced controllers to try.")] = 300,
    json: Json = False,
) -> None:
    """Lower the order of a controller as far as the check still proves everything that it proved
    before.

    Exit code 0: all proofs are kept. If no lower order keeps them, the controller is written
    unchanged. Exit code 1: --order loses a proof; the controller is written.
    """
    json_path(out)
    _require_demand(bandwidth, error)
    plant = models.load_model(model)
    [(K, late)] = from_options.load_loops([controller], delay, plant.origin.unit)
    w_P = from_options.demand_weight(plant, bandwidth, peak, error)
    with spinner("reducing"):
        result = robust.reduce_controller(
            K, plant, w_P, order=order, delay=late, max_candidates=candidates
        )
    # a delay of zero that was only assumed does not become a known one in the file
    known = delay is not None or from_options.load_controller(controller)[1] is not None
    robust.save(result.K, out, delay=late if known else None, unit=plant.origin.unit)
    printer(json)(result)
    finish_command(result, result.kept, json)


@app.command()
def report(
    model: Annotated[Path, typer.Argument(help="Model from 'robust model'.")],
    controller: Annotated[Path, typer.Argument(help=f"Controller: {_CONTROLLER_FILES}.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Report to write (.html).")],
    bla: Annotated[
        list[Path] | None,
        typer.Option(
            "--bla",
            help="BLA behind the model; may be repeated. Default: identified from the record.",
        ),
    ] = None,
    record: Annotated[
        list[Path] | None, typer.Option("--record", help="Measured record; may be repeated.")
    ] = None,
    input: Annotated[
        str | None,
        typer.Option(
            "--input", help="Name of the input in the record; default: that of the model."
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output", help="Name of the output in the record; default: that of the model."
        ),
    ] = None,
    reference: Annotated[
        list[str] | None,
        typer.Option(
            help="Name of the reference in the record; may be repeated, one for each input."
        ),
    ] = None,
    fs: Annotated[
        float | None,
        typer.Option(help="Sampling frequency of the record [Hz]; default: from the file."),
    ] = None,
    period: Annotated[
        int | None,
        typer.Option(help="Samples in one period of the record; default: found in the input."),
    ] = None,
    discard: Annotated[
        int, typer.Option(help="Periods to leave out at the start of the record.")
    ] = 0,
    resample: Resample = False,
    delay: Delay = None,
    bandwidth: Annotated[
        float | None, typer.Option(help="Performance: required bandwidth of S [Hz].")
    ] = None,
    peak: Annotated[float, typer.Option(help="Performance: largest allowed |S|.")] = 2.0,
    error: Annotated[
        float, typer.Option(help="Performance: largest |S| at zero frequency.")
    ] = 1e-2,
    stiffness: Annotated[
        float | None,
        typer.Option(
            help=(
                "Presliding stiffness of the friction [N/m], for a proof with friction beside the"
                " check."
            )
        ),
    ] = None,
    stiction: Annotated[
        float,
        typer.Option(help="Largest over smallest force of a slider, for the proof with friction."),
    ] = 1.5,
    force: Annotated[
        float | None,
        typer.Option(help="Largest friction force [N], for a kick after which the loop runs away."),
    ] = None,
    reference_step: StepHeight = None,
    disturbance: DisturbanceRms = None,
    noise: NoiseRms = None,
    up_to: NoiseBand = None,
    title: Annotated[str, typer.Option(help="Heading of the report.")] = "Controller report",
    notes: Annotated[str, typer.Option(help="Further text for the reader.")] = "",
) -> None:
    """Write a whole run as one HTML file: record, BLA, model, controller, check and proof.

    Exit code 0: the loop is proved stable with the whole set, and the demand and the proof with
    friction, if there are any, hold. Exit code 1: not so; the page is written.
    """
    _require_demand(bandwidth, error)
    plant = models.load_model(model)
    [(K, late)] = from_options.load_loops([controller], delay, plant.origin.unit)
    load = partial(
        nlfrf.load_record,
        u=(input or (*plant.inputs, "u")[0]) if plant.is_single else list(plant.inputs),
        y=(output or (*plant.outputs, "y")[0]) if plant.is_single else list(plant.outputs),
        r=reference[0] if reference and plant.is_single else reference or None,
        fs=fs,
        n_samples=period,
        n_discard=discard,
        resample=resample,
    )
    blas = [models.load_bla(path) for path in bla or []]
    w_P = from_options.demand_weight(plant, bandwidth, peak, error)
    proof = None
    if stiffness is not None:
        basis = to_prove.read_basis(
            to_prove.MachineFiles(
                files=(model,), controller=controller, stiffness=stiffness, stiction=stiction
            )
        )
        # the first proof is the weakest: the page claims what holds with each machine
        proof = prover.prove_all(basis.machines, K, basis.friction, delay=late, Fs=force)[0]
    with spinner("checking and drawing"):
        result = robust.reports.write_report(
            out,
            plant,
            K,
            bla=blas,
            record=[from_options.with_units_of(load(path), blas) for path in record or []],
            w_P=w_P,
            delay=late,
            friction=proof,
            signals=from_options.signals_from_options(reference_step, disturbance, noise, up_to),
            title=title,
            notes=notes,
        )
    print(f"verdict: {result.headline}: {result.meaning}")
    for condition in result.conditions:
        print(f"condition: {condition}")
    if proof is not None:
        print(f"friction: {proof.verdict}")
    good = result.proofs.robustly_stable and (result.proofs.robust_performance or w_P is None)
    finish_command(
        result, good and (proof is None or proof.verdict is FrictionVerdict.PROVED), json=False
    )


@app.command()
def shape(
    model: Annotated[
        list[Path], typer.Argument(help="Model from 'robust model'; several are shown together.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Page to write (.html).")],
    controller: Annotated[
        Path | None, typer.Option(help="Controller at the start; default: made for the plant.")
    ] = None,
    sample_time: Annotated[
        float, typer.Option(help="Sampling time [s] of the controller; 0 for continuous.")
    ] = 0.0,
    delay: Delay = None,
    bandwidth: Annotated[
        float | None, typer.Option(help="Performance: required bandwidth of S [Hz].")
    ] = None,
    peak: Annotated[float, typer.Option(help="Performance: largest allowed |S|.")] = 2.0,
    error: Annotated[
        float, typer.Option(help="Performance: largest |S| at zero frequency.")
    ] = 1e-2,
) -> None:
    """Write a page to shape a loop by hand in any browser; it needs no server and proves
    nothing.
    """
    _require_demand(bandwidth, error)
    models, K, late = [from_options.load_single_model(path) for path in model], None, delay or 0.0
    if controller is not None:
        [(K, late)] = from_options.load_loops([controller], delay, models[0].origin.unit)
    from_options.require_delay(late, sample_time)
    shaping_page.write_from_files(
        out, models, K, (model, controller), (bandwidth, peak, error), dt=sample_time, delay=late
    )


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
    plant, (peak, error, factor) = models.load_model(model), demands
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
            G = sampling.delayed(G, delay, order=_PADE_ORDER)
        found = robust.ncfsyn(
            G, robust.shaping.crossover_weight(G, 2 * np.pi * bandwidth), factor=factor
        )
    if not found.met:
        raise ValueError(f"model must allow a controller, got none: {found.reason}")
    return plant, found


def _controller_file(controller: Path, out: Path | None, several: bool) -> Path | None:
    """Return the file for one of several controllers."""
    if several and out is not None:
        return out.with_stem(f"{out.stem}-{controller.stem}")
    return out


def _describe_limit_checks(
    plant: nlfrf.Bla | robust.UncertaintyModel, model: Path, *, between: bool
) -> str:
    """Return text on the place where the limits of a design were tried."""
    if not isinstance(plant, nlfrf.Bla) and not plant.measured_only:
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
    if len(result.omega_c) == 2 and max(result.crossovers, default=0) > 0.98 * result.omega_c[1]:
        helps.append("--crossover-within inf, if a mode above the crossover may lift |L| above one")
    return f"to meet the limits: {'; or '.join(helps)}"


def _require_demand(bandwidth: float | None, error: float) -> None:
    """Refuse a demand on S that is not positive, with the names of its options."""
    require_positive("--error", error)
    if bandwidth is not None:
        require_positive("--bandwidth", bandwidth)


def main() -> None:
    """Run the command `robust`."""
    run_command("robust", app, nlfrf.DataWarning, robust.DesignWarning, options=_OPTIONS)


if __name__ == "__main__":
    main()
