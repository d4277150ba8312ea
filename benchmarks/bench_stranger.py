"""Servo axes that share no code with the packages, through files and commands, as
`docs/howto/servo_axis.md` has it.

    python -m benchmarks.bench_stranger [--kind random] [--first 0] [--count 40] [--folder FOLDER]
    [--rig axis_rig.py]
        [--attack friction]

The rig is a file of its own, outside this project: `play`, `random_axis`, `hunting_axis`,
`with_load` and `rests`. Each axis has a folder with its files, played once; a second run checks the
same traces again. The data sheet of an axis has its true mass and force constant, and its gains.
What is printed is the table of counts; every axis without a verdict is listed with its reason.

An attack plays what the files leave out: friction that has grown by 30 % when the axis moves
(`friction`), a low-pass of 0.5 ms that the file does not name (`filter`), a ripple of 30 % of the
Coulomb friction (`ripple`), a play of 2 um between the axis and its encoder (`backlash`). The truth
is that of the axis as it is in the end, at its encoder.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import json
import math
import re
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

RIG = Path(__file__).parents[2] / "shared" / "axis_rig" / "axis_rig.py"
SMALL = 1e-7  # m: a swing below it is rest
NEVER = 1e9  # s: a reset time of no integral part
FAR = 20.0  # times T4 of the true numbers: a bound above it says nothing
#: What an axis is in the end that the files leave out, by what it was.
ATTACKS: dict[str, Callable[[Any], dict[str, float]]] = {
    "none": lambda axis: {},
    "friction": lambda axis: {"Fc": 1.3 * axis.Fc, "Fs": 1.3 * axis.Fs},
    "filter": lambda axis: {"lag": axis.lag + 5e-4},
    "ripple": lambda axis: {"ripple": 0.3 * axis.Fc},
    "backlash": lambda axis: {},
}
#: Play of the attack [m], and the line of the rig that reads the encoder, which it stands before.
BACKLASH, ENCODER = 2e-6, "        y = round(x1 / res) * res\n"
PLAYED = f"""\
        back = min(max(back, x1 - {BACKLASH / 2}), x1 + {BACKLASH / 2}) if n_ else x1
        y = round(back / res) * res
"""


def with_backlash(path: Path, folder: Path) -> Path:
    """A rig whose encoder follows the axis with play, as a file in a folder."""
    text, start = path.read_text(), "    x1 = x2 = start\n"
    if text.count(ENCODER) != 1 or text.count(start) != 1:
        raise SystemExit(f"rig must read its encoder in one line, got another {path}")
    folder.mkdir(parents=True, exist_ok=True)
    changed = folder / "rig_with_backlash.py"
    changed.write_text(text.replace(ENCODER, PLAYED).replace(start, start + "    back = start\n"))
    return changed


def load_rig(path: Path) -> ModuleType:
    """The rig as a module."""
    spec = importlib.util.spec_from_file_location("axis_rig", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise SystemExit(f"rig must be a file with servo axes, got {path}")
    rig = importlib.util.module_from_spec(spec)
    sys.modules["axis_rig"] = rig
    spec.loader.exec_module(rig)
    return rig


def axis_of(rig: ModuleType, kind: str, seed: int) -> Any:
    """One axis of a kind."""
    if kind == "load":
        return rig.with_load(rig.random_axis(seed), seed)
    return (rig.hunting_axis if kind == "hunting" else rig.random_axis)(seed)


def run(command: str, *arguments: object) -> tuple[int, str, str]:
    """Exit code, output and errors of a command, in this process."""
    from nlfrf import cli as nlfrf_cli
    from robust import cli as robust_cli

    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = [command, *map(str, arguments)]
    code = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            (nlfrf_cli if command == "nlfrf" else robust_cli).main()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
    sys.argv = before
    return code, out.getvalue(), err.getvalue()


def write_files(axis: Any, folder: Path) -> None:
    """axis.toml and gains.toml, from the data sheet."""
    load = (
        f"load_inertia = {axis.load!r}\nstiffness = {axis.stiffness!r}\ndamping ="
        f" {float(axis.damping)!r}\n" * bool(axis.load)
    )
    (folder / "axis.toml").write_text(f"""motion = "linear"
motor_inertia = {axis.mass!r}
motor_damping = 0.0
resolution = {axis.resolution!r}
{load}[drive]
fs = {axis.fs!r}
kv = {axis.kv!r}
kp = {axis.kp!r}
tn = {axis.tn!r}
lag = {axis.lag!r}
delay_periods = {float(axis.delay_periods)!r}
torque_constant = {axis.force_constant!r}
limit = {axis.max_current!r}
velocity_feedforward = {axis.feedforward!r}
""")
    (folder / "gains.toml").write_text(f"""fs = "{axis.fs!r} Hz"
kv = "{axis.kv!r} 1/s"
kp = "{axis.kp!r} A/(m/s)"
tn = "{axis.tn!r} s"
torque_constant = "{axis.force_constant!r} N/A"
lag = "{axis.lag!r} s"
delay = "{axis.delay_periods / axis.fs!r} s"
""")


def play(rig: ModuleType, axis: Any, folder: Path, attack: str = "none") -> None:
    """Both experiments, designed and played; a folder that has them is left as it is."""
    if (folder / "ramp-trace.csv").exists():
        return
    folder.mkdir(parents=True, exist_ok=True)
    write_files(axis, folder)
    bandwidth = axis.kp * axis.force_constant / (axis.mass + axis.load) / 2 / np.pi
    top = min(8 * bandwidth, 0.4 * axis.fs)
    if axis.load:  # beyond the resonance of motor and load
        resonance = np.sqrt(axis.stiffness * (1 / axis.mass + 1 / axis.load)) / 2 / np.pi
        top = min(max(top, 1.6 * resonance), 0.4 * axis.fs)
    most = 0.95 * axis.max_current * axis.force_constant
    limits = ["--max-force", most, "--max-travel", 2.0, "--seed", 1]
    common = [folder / "axis.toml", *limits]
    ramp = [
        *common,
        "--period",
        int(2 * axis.fs),
        "--f-min",
        1.5,
        "--f-max",
        top / 2,
        "--ramp",
        16,
        "--rms",
        min(3 * axis.Fs, most / 4.2),
        "-o",
        folder / "ramp.csv",
    ]
    moving = [
        *common,
        "--period",
        int(axis.fs),
        "--f-min",
        max(3.0, bandwidth / 6),
        "--f-max",
        top,
        "--velocity",
        0.1,
        "--strokes",
        1,
        "-o",
        folder / "moving.csv",
    ]
    for arguments in (ramp, moving):
        code, _, said = run("robust", "servo", "design", *arguments)
        if code:
            raise RuntimeError(said)
    for name, trace in (("moving", "trace"), ("ramp", "ramp-trace")):
        data = np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1)
        grows = attack == "friction" and name == "ramp"  # after the pre-test
        u, y, _ = rig.play(axis if grows else replace(axis, **ATTACKS[attack](axis)), data[:, 1])
        table = np.c_[data[:, 0], u, y]
        head = "t [s],force set point [N],position [m]"
        np.savetxt(
            folder / f"{trace}.csv", table, delimiter=",", header=head, comments="", fmt="%.10g"
        )


def truth(rig: ModuleType, axis: Any, folder: Path) -> tuple[float, float]:
    """Largest error and swing in the end, over three histories; kept in the folder."""
    file = folder / "truth.json"
    if not file.exists():
        file.write_text(json.dumps(rig.rests(axis)))
    error, swing = json.loads(file.read_text())
    return float(error), float(swing)


def bound_of_truth(axis: Any) -> float:
    """T4 with the true numbers [m]: the peak gain of the linear loop times the largest friction
    force.
    """
    from nlfrf.rig import Drive
    from robust import friction_plant, prove_friction
    from robust.friction import Bounded
    from robust.servo.checking.friction import friction_behind_lag
    from robust.servo.gains.p_pi import cascade

    settings = Drive(
        fs=axis.fs,
        kv=axis.kv,
        kp=axis.kp,
        kp_unit="A/(m/s)",
        tn=axis.tn,
        torque_constant=axis.force_constant,
        lag=axis.lag,
        delay_periods=axis.delay_periods,
    )
    plant = friction_behind_lag(friction_plant(axis.mass + axis.load, 0.0, axis.viscous), axis.lag)
    largest = axis.Fc if axis.law == "dahl" else axis.Fs
    found = prove_friction(
        plant, cascade(settings, output_unit="N"), Bounded(largest), delay=settings.delay
    )
    return float(found.error_bound)


def check(folder: Path, *options: object) -> tuple[int, dict[str, Any], str, float]:
    """What the command says of both traces: exit code, values, errors, seconds."""
    start = time.perf_counter()
    code, out, err = run(
        "robust",
        "servo",
        "check",
        folder / "ramp-trace.csv",
        folder / "trace.csv",
        folder / "gains.toml",
        "--design",
        folder / "ramp.npz",
        "--design",
        folder / "moving.npz",
        "--json",
        *options,
    )
    taken = time.perf_counter() - start
    try:
        return code, json.loads(out), err, taken
    except json.JSONDecodeError:
        return code, {}, err or out, taken


def play_advice(axis: Any, advice: str) -> Any | None:
    """The axis with the gain that is advised; None without advice."""
    found = re.match(r"(tn|kv|kp) \S+(?: \S+)? -> (none|[\d.e+-]+)", advice)
    if found is None:
        return None
    name, number = found.groups()
    number = NEVER if number == "none" else float(number) * (1e-3 if name == "tn" else 1.0)
    return replace(axis, **{name: number})


def swing_of(rig: ModuleType, axis: Any) -> float:
    """Swing in the end, over the histories of the rig; one move alone without an integral part,
    which nothing winds.
    """
    if axis.tn < NEVER:
        return float(rig.rests(axis)[1])
    axis = replace(axis, resolution=1e-13)
    set_point = np.repeat([0.0, 1e-4, -3e-4], (np.array([0.2, 0.5, 5.0]) * axis.fs).astype(int))
    return float(np.ptp(rig.play(axis, set_point)[1][-int(axis.fs) :]))


class Counts(Counter[str]):
    """Counts with what they are out of."""

    def of(self, name: str, holds: bool) -> None:
        """One more axis of which a thing holds or not."""
        self[f"{name} of"] += 1
        self[name] += bool(holds)

    def __str__(self) -> str:
        names = [name for name in self if not name.endswith(" of") and f"{name} of" in self]
        return "\n".join(f"{name:60s} {self[name]:4d} of {self[f'{name} of']}" for name in names)


def inside(interval: Any, true: float) -> bool:
    """Whether an interval holds a number."""
    return bool(interval) and None not in interval and interval[0] <= true <= interval[1]


def compare(
    rig: ModuleType, axis: Any, folder: Path, counts: Counts, listed: dict[str, list[float]]
) -> str:
    """Check one axis, count what is right and what is false; a row for the list."""
    code, found, err, taken = check(folder, *(["--masses", 2] if axis.load else []))
    error, swing = truth(rig, axis, folder)
    linear, friction = found.get("linear", {}), found.get("friction", {})
    counts.of("linear verdict printed", bool(linear.get("verdict")))
    within = friction.get("within")
    within = math.nan if within is None else float(within)
    outcome = friction.get("outcome", "none")
    reference = bound_of_truth(axis)
    proved = outcome in ("rests", "settles") and (outcome == "rests" or within < FAR * reference)
    counts.of("friction: proved or refuted", proved or outcome == "refuted")
    answers, force = found.get("answers", {}), friction.get("force") or {}
    late = [
        [found.get(name, {}).get(part) for part in ("delay_periods", "lag")]
        for name in ("given", "settings")
    ]
    counts.of(
        "the records refute the model, and it is said",
        bool(force.get("contradiction")) or late[0] != late[1],
    )
    counts["false of"] += 1
    false = (outcome == "rests" and swing > SMALL) or (outcome == "settles" and error > within)
    counts["false"] += false
    if axis.law == "maxwell" and swing < SMALL:
        counts.of("Maxwell slip proved to rest", outcome == "rests")
    if outcome == "settles" and swing > 1e-6:
        listed["within over error of hunters"].append(within / error)
    if (simulated := friction.get("simulated")) is not None:
        if swing > 1e-6:
            amplitude = friction.get("simulated_amplitude") or math.nan
            right = simulated == "hunts" and 0.5 < amplitude / (swing / 2) < 2
            counts.of("simulated: hunters named, amplitude within 2", right)
            if (advised := play_advice(axis, friction.get("advice") or "")) is not None:
                counts.of(
                    "advice played: rests, or half the swing", swing_of(rig, advised) < swing / 2
                )
            else:
                counts.of("advice played: rests, or half the swing", False)
        elif swing < SMALL:
            counts.of("simulated: axes at rest named", simulated == "rests")
    mass = friction.get("mass")
    total = axis.mass + axis.load
    counts.of("mass within 2 %", mass is not None and abs(mass / total - 1) < 0.02)
    counts.of("mass in its interval", inside(friction.get("mass_interval"), total))
    delay = friction.get("delay")
    true = axis.delay_periods / axis.fs + axis.lag
    counts.of(
        "delay within 5 % of a period", delay is not None and abs(delay - true) < 0.05 / axis.fs
    )
    largest = axis.Fc if axis.law == "dahl" else axis.Fs
    interval = friction.get("Fs_interval")
    counts.of("Fs in its interval", inside(interval, largest))
    if interval and None not in interval:
        listed["width of Fs"].append((interval[1] - interval[0]) / largest)
        listed["Fs read"].append(sum(interval) / 2 / largest)
    if (K0 := friction.get("K0_used")) and axis.law != "rigid":
        counts.of("K0 used above the true one", K0 > axis.K0)
        listed["K0 used over the true one"].append(K0 / axis.K0)
    if (laws := friction.get("laws")) is not None:
        counts.of("true law not refuted", any(axis.law[:4] in law.lower() for law in laws))
    listed["seconds"].append(taken)
    reason = friction.get("reason") or err.strip()
    return (
        f"{axis.law:8s} {'FALSE ' * false}{outcome:8s} within {within:9.3g} (T4 of the truth"
        f" {reference:.3g}, error {error:.2g}, swing {swing:.2g}) exit {code} in {taken:.1f} s |"
        f" {linear.get('verdict', '')[:40]} | Fs {interval} of {largest:.4g} |"
        f" {answers.get('traces', '')[:60]} | {reason[:300]}"
    )


def main() -> None:
    """Print a row for each axis, then the counts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kind", default="random", choices=("random", "hunting", "load"))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--folder", type=Path, default=Path("build") / "stranger")
    parser.add_argument("--rig", type=Path, default=RIG)
    parser.add_argument("--attack", default="none", choices=tuple(ATTACKS))
    given = parser.parse_args()
    rig = load_rig(
        with_backlash(given.rig, given.folder) if given.attack == "backlash" else given.rig
    )
    counts = Counts()
    listed: dict[str, list[float]] = {}
    for name in (
        "within over error of hunters",
        "width of Fs",
        "Fs read",
        "K0 used over the true one",
        "seconds",
    ):
        listed[name] = []
    for seed in range(given.first, given.first + given.count):
        axis = axis_of(rig, given.kind, seed)
        folder = given.folder / given.attack / f"{given.kind}-{seed}"
        try:
            play(rig, axis, folder, given.attack)
            axis = replace(axis, **ATTACKS[given.attack](axis))
            print(f"{seed:3d} {compare(rig, axis, folder, counts, listed)}", flush=True)
        except RuntimeError as error:
            print(f"{seed:3d} {axis.law} not played: {error}", flush=True)
    print(counts)
    for name, values in listed.items():
        if values:
            low, middle, high = np.quantile(values, (0.05, 0.5, 0.95))
            print(f"{name:60s} {middle:.3g} in the middle, {low:.3g} to {high:.3g} ({len(values)})")


if __name__ == "__main__":
    main()
