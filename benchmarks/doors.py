"""Files of every kind drawn by chance, through the public functions: right, warned of, refused, or
wrong in silence.

python -m benchmarks.doors --files 2000 --seed 0   # counts by kind, and every silent wrong answer
python -m benchmarks.doors --write 17 folder       # the file of one seed, and how it is read
python -m benchmarks.doors --kind "outliers"       # one kind alone

Right is NumPy's FRF of the system behind the file: within 2 % on most lines, and on nearly all
within that, the noise or the bound of the record. A warning or a refusal counts where it names the
kind; a refusal also where the cure that it names, tried as it stands, ends right. What `nlfrf
inspect` prints is run for a share of the files.
"""

from __future__ import annotations

import argparse
import enum
import itertools
import re
import shlex
import sys
import tempfile
import time
import warnings
from collections import Counter, defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from typer.testing import CliRunner

import nlfrf
import robust
from benchmarks.drawn_files import KINDS, Case, draw, draw_kind
from benchmarks.readers_here import readers_in_this_process
from nlfrf import cli as measuring
from nlfrf.io.measurement_files import read_channels
from robust import cli as controlling

COMMAND_SHARE = 0.05  # of the files, on which the commands are run, too
TOLERANCE, SIGMAS = 0.02, 4.0
MOST, NEARLY_ALL = 0.75, 0.95  # shares of the lines within tolerance, and within it or the bound
NEARLY_ALL_LINES = (
    0.9  # share of the lines that an estimate must have, and of its own that must be true ones
)
#: Warnings of faults of the samples, of which sound records must have next to none.
FAULT_WORDS = re.compile(r"outlier|spike|wrap|whole turn|\bhits?\b|hammer", re.I)
WRONG = "wrong without a word"
SOUND_SHARE, FAULT_SHARE = 0.98, 0.005  # what is asked for


class Outcome(enum.Enum):
    """What became of a file."""

    RIGHT = "right"
    WARNED = "right, warned of the kind"
    OTHER = "right, another warning"
    WARNED_WRONG = "not right, warned of the kind"
    REFUSED = "refused, cured or named"
    DEAD_END = "refused, no cure"
    CRASH = "crash"
    SILENT = "WRONG WITHOUT A WORD OF THE KIND"


@dataclass
class Result:
    """The outcome of one file, what was said of it, and what `inspect` and its command did."""

    case: Case
    outcome: Outcome
    said: list[str] = field(default_factory=list)
    detail: str = ""
    commands: str = ""


def compare(case, bla):
    """Why a `Bla` is not that of the system; empty where it is."""
    run = case.run
    if case.unit and bla.unit and bla.unit.replace(" ", "") != case.unit.replace(" ", ""):
        return f"unit {bla.unit}, not {case.unit}"
    if case.any_lines:
        same, truths, scatter = slice(None), [run.at(bla.f)], 0.0
    else:
        near = np.argmin(np.abs(bla.f[:, None] - run.f), axis=1)
        same = np.abs(bla.f / run.f[near] - 1) < 1e-3
        near = near[same]
        if same.mean() < NEARLY_ALL_LINES or np.unique(near).size < NEARLY_ALL_LINES * run.f.size:
            return (
                f"lines {bla.f[0]:.4g} to {bla.f[-1]:.4g} Hz, not {run.f[0]:.4g} to"
                f" {run.f[-1]:.4g} Hz"
            )
        truths = [run.G[near]] if case.table else [run.G[near], run.measured()[near]]
        scatter = case.gain * run.scatter[near] * (not case.table)
    scale = case.gain * np.abs(truths[0])
    known = np.maximum(TOLERANCE * scale, SIGMAS * scatter)
    error = np.min([np.abs(bla.G[same] - case.gain * one) for one in truths], axis=0)
    if (
        np.mean(error <= known) < MOST
        or np.mean(error <= np.maximum(known, bla.bound()[same])) < NEARLY_ALL
    ):
        share = 100 * error / scale
        return f"off by {np.median(share):.3g} % at the median line, {share.max():.3g} % at most"
    return ""


def estimate(case, path, *, u=None, y=None, **options):
    """Load and identify: (Bla or None, warnings, error)."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            bla = nlfrf.identify(nlfrf.load_record(path, u=u or case.u, y=y or case.y, **options))
            error = None
        except Exception as raised:
            bla, error = None, raised
    return (
        bla,
        [str(one.message) for one in caught if issubclass(one.category, nlfrf.DataWarning)],
        error,
    )


def judge(case, path):
    """The outcome of one record, read through the public functions."""
    bla, said, error = estimate(case, path, **case.options)
    if error is not None:
        return refusal(case, path, error, said)
    wrong = compare(case, bla)
    named = any(re.search(case.words, text, re.I) for text in said) and not case.sound
    harmless = case.sound and all(re.search(case.allowed, text, re.I) for text in said)
    if wrong:
        outcome = Outcome.WARNED_WRONG if named else Outcome.SILENT
    elif not said or harmless:
        outcome = Outcome.RIGHT
    else:
        outcome = Outcome.WARNED if named else Outcome.OTHER
    return Result(case, outcome, said, wrong)


def refusal(case, path, error, said):
    """The outcome of a refusal: its cure is tried as it stands."""
    text = str(error)
    if not isinstance(error, ValueError) or "\n" in text or "Traceback" in text:
        return Result(case, Outcome.CRASH, said, f"{type(error).__name__}: {text}")
    options, found = dict(case.options), None
    if text.startswith("fs must be given"):
        options["fs"] = case.run.fs
    if "must name a signal" in text:
        found = names_of(case, path)
    if "resample=True" in text:
        options["resample"] = True
    if number := re.search(r"\bn_discard ?= ?(\d+)", text.split("got")[-1]):
        options["n_discard"] = int(number[1])
    if options != case.options or found:
        bla, more, again = estimate(case, path, **options, **(found or {}))
        wrong = "" if bla is None else compare(case, bla)
        named = any(re.search(case.words, one, re.I) for one in more)
        if bla is not None and wrong and not named:
            return Result(
                case,
                Outcome.SILENT,
                said + more,
                f"by the cure {options}: {wrong}; refused: {text}",
            )
        if bla is not None:
            return Result(case, Outcome.REFUSED, said + more, text)
        text = f"{text}; and by its cure {options}: {again}"
    named = re.search(case.words, text, re.I) and case.words != "."
    return Result(case, Outcome.REFUSED if named else Outcome.DEAD_END, said, text)


def names_of(case, path):
    """The channels of a file that hold the input and the output, as one finds them who looks at the
    numbers.
    """
    arrays = read_channels(path).arrays
    found = {}
    for key, stream in (("u", case.run.u), ("y", case.run.y)):
        for name, array in arrays.items():
            same = (
                array.shape == stream.shape
                and array.dtype.kind in "fiu"
                and np.isfinite(array).all()
            )
            if same and np.ptp(array) > 0 and abs(np.corrcoef(array, stream)[0, 1]) > 0.9999:
                found[key] = name
                break
    return found if len(found) == 2 else None


# ---- Commands


def invoke(app, words):
    """Run a command in this process: (exit code, what it printed, warnings, error)."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        done = CliRunner().invoke(app, words)
    said = [str(one.message) for one in caught]
    error = done.exception if done.exc_info and not isinstance(done.exception, SystemExit) else None
    return done.exit_code, done.output, said, error


def printed_command(printed, case, out):
    """The command that `nlfrf inspect` printed, word by word, with what it leaves to the user
    filled in.
    """
    words = next(
        (shlex.split(line[5:]) for line in printed.splitlines() if line.startswith("run:")), []
    )
    filled = {
        "HERTZ": f"{case.run.fs:.12g}",
        "POLES": "2",
        "RELATIVE-STD": "0.02",
        "AVERAGES": "16",
    }
    words = [filled.get(word, word) for word in words]
    if "-o" in words:
        words[words.index("-o") + 1] = str(out)
        words.append("--overwrite")
    return words


def commands(case, path):
    """What `nlfrf inspect` and the command that it prints do: empty where all is well."""
    code, printed, _, error = invoke(measuring.app, ["inspect", str(path)])
    if code:
        return "" if isinstance(error, ValueError) else f"inspect ends with {code}: {error!r}"
    out = path.with_name("bla.npz")
    words = printed_command(printed, case, out)
    if words[:2] != ["nlfrf", "identify"]:
        return f"inspect prints {' '.join(words) or 'no command'}"
    given = dict(itertools.pairwise(words))
    u, y = given["--input"], given["--output"]
    if {u, y} & {"INPUT", "OUTPUT"}:
        return "inspect finds no input or no output"
    code, _, said, error = invoke(measuring.app, words[1:])
    if code:
        known = isinstance(error, ValueError)
        return (
            f"its command is refused: {error}"
            if known
            else f"its command ends with {code}: {error!r}"
        )
    file = read_channels(path)
    if strictly_rising(file.arrays.get(y, np.zeros(2))):
        return f"it proposes the rising column {y} as output"
    if [one.strip('"') for one in (u, y)] != list(map(file.full_name, (case.u, case.y))):
        return f"it guesses input {u}, output {y}"
    wrong = compare(case, nlfrf.load(out))
    return f"its command is {WRONG}: {wrong}" if wrong and not said else ""


def strictly_rising(stream):
    """Whether every sample is above the one before it, as of a clock or a counter."""
    return stream.size > 1 and bool(np.all(np.diff(stream) > 0))


def judge_frf(case, path):
    """The outcome of a table of an FRF: no command takes it for a record, and `robust model` takes
    it as it is.
    """
    out, model = path.with_name("bla.npz"), path.with_name("model.json")
    code, printed, _, error = invoke(measuring.app, ["inspect", str(path)])
    text = str(error) if code else printed
    words = [] if code else printed_command(printed, case, out)
    if words[:2] == ["nlfrf", "identify"]:
        done, _, said, _ = invoke(measuring.app, words[1:])
        if not done and not said:
            return Result(case, Outcome.SILENT, [], f"identified as a record: {' '.join(words)}")
    if words[:2] != ["robust", "model"]:
        words = ["robust", "model", str(path), "--poles", "2", "-o", str(model)]
    words[words.index("-o") + 1] = str(model)
    code, _, said, error = invoke(controlling.app, words[1:])
    if not code:
        one = robust.load(model).records[0]
        wrong = compare(
            case,
            SimpleNamespace(
                f=one.omega / (2 * np.pi), G=one.G, unit="", bound=lambda: 0 * one.omega
            ),
        )
        if wrong:
            return Result(case, Outcome.WARNED_WRONG if said else Outcome.SILENT, said, wrong)
        return Result(case, Outcome.OTHER if said else Outcome.RIGHT, said)
    if not isinstance(error, ValueError | None):
        return Result(case, Outcome.CRASH, said, repr(error))
    named = re.search(case.words, f"{text} {error}", re.I)
    return Result(
        case, Outcome.REFUSED if named else Outcome.DEAD_END, said, f"{text} {error}"[-300:]
    )


def result_of(case, folder, *, with_commands=False):
    """The outcome of one case, written into a folder."""
    path = case.save(Path(folder))
    if case.table:
        return judge_frf(case, path)
    result = judge(case, path)
    if not with_commands:
        return result
    did = commands(case, path)
    outcome = (
        Outcome.SILENT if WRONG in did and result.outcome is not Outcome.CRASH else result.outcome
    )
    return replace(result, commands=did, outcome=outcome)


# ---- The whole


def run_cases(cases, *, share=COMMAND_SHARE):
    """The results of cases, each in a folder of its own."""
    results = []
    with readers_in_this_process():
        for i, case in enumerate(cases):
            with tempfile.TemporaryDirectory() as folder:
                every = round(1 / share) if share else 0
                results.append(
                    result_of(case, folder, with_commands=bool(every and i % every == 0))
                )
    return results


def print_table(results):
    """Counts by kind and outcome."""
    counts = defaultdict(Counter)
    for one in results:
        counts[one.case.kind][one.outcome] += 1
    heads = ("right", "warned", "other w.", "wrong+w.", "refused", "dead end", "crash", "SILENT")
    print(f"{'kind':<48}{'files':>6}" + "".join(f"{head:>10}" for head in heads))
    for name in KINDS:
        if row := counts[name]:
            print(
                f"{name:<48}{row.total():>6}" + "".join(f"{row[one] or '':>10}" for one in Outcome)
            )
    total = Counter(one.outcome for one in results)
    print(f"{'all':<48}{total.total():>6}" + "".join(f"{total[one] or '':>10}" for one in Outcome))


def print_sound(results):
    """How sound files fare; whether they do as is asked for."""
    sound = [one for one in results if one.case.sound]
    if not sound:
        return True
    right = sum(one.outcome is Outcome.RIGHT for one in sound)
    faults = sum(any(FAULT_WORDS.search(text) for text in [*one.said, one.detail]) for one in sound)
    print(
        f"sound files: {right} of {len(sound)} right without a warning"
        f" ({100 * right / len(sound):.1f} %); {faults} with words of outliers, wraps or hits"
        f" ({100 * faults / len(sound):.2f} %)"
    )
    return right >= SOUND_SHARE * len(sound) and faults <= FAULT_SHARE * len(sound)


def print_details(results, *, most):
    """Silent wrong answers, all of them; and by kind some of what else is not as it should be."""
    for one in results:
        if one.outcome is Outcome.SILENT:
            print(
                f"  seed {one.case.seed} ({one.case.kind}): {one.detail or one.commands}"
                f" {one.said or ''}"
            )
            print(
                f'    python -m benchmarks.doors --kind "{one.case.kind}" --write {one.case.seed}'
                " FOLDER"
            )
    shown = Counter()
    for one in results:
        bad = one.outcome in (Outcome.CRASH, Outcome.DEAD_END) or (
            one.case.sound
            and one.outcome is not Outcome.RIGHT
            and one.outcome is not Outcome.SILENT
        )
        if bad and (shown[one.case.kind] < most or one.outcome is Outcome.CRASH):
            shown[one.case.kind] += 1
            print(
                f"  seed {one.case.seed} ({one.case.kind}): {one.outcome.value}: {one.detail[:300]}"
                f" {one.said or ''}"
            )
    tried = [one for one in results if one.commands]
    for one in tried[: 4 * most]:
        print(f"  seed {one.case.seed} ({one.case.kind}): {one.commands[:200]}")


def main():
    """Print it; 1 where an answer is wrong in silence, or too few sound files are read."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", choices=list(KINDS), help="this kind alone")
    parser.add_argument(
        "--details", type=int, default=3, help="refusals and warnings of each kind that are printed"
    )
    parser.add_argument(
        "--write", nargs=2, metavar=("SEED", "FOLDER"), help="write the file of one seed"
    )
    given = parser.parse_args()
    make = draw if given.kind is None else lambda seed: draw_kind(given.kind, seed)
    if given.write:
        case = make(int(given.write[0]))
        folder = Path(given.write[1])
        folder.mkdir(parents=True, exist_ok=True)
        print(f"{case.kind}: {case.save(folder)}")
        print(f"nlfrf.load_record({case.file!r}, u={case.u!r}, y={case.y!r}, **{case.options})")
        return 0
    begin = time.perf_counter()
    results = run_cases(make(seed) for seed in range(given.seed, given.seed + given.files))
    print_table(results)
    met = print_sound(results)
    silent = sum(one.outcome is Outcome.SILENT for one in results)
    tried = sum(bool(one.commands) for one in results)
    print(
        f"silent wrong answers: {silent}; commands that did not end right: {tried};"
        f" {time.perf_counter() - begin:.0f} s"
    )
    print_details(results, most=given.details)
    return int(silent > 0 or not met)


if __name__ == "__main__":
    sys.exit(main())
