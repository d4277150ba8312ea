"""Hand every file to every command in place of the one it wants: an answer, or one line and exit
code 2; no traceback.

python -m benchmarks.fuzz_commands [--jobs 750]
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
import tempfile
import warnings
from pathlib import Path
from unittest import mock

import control
import numpy as np

import nlfrf
import robust
from nlfrf import cli as measuring
from robust import cli as controlling

MEASURING = (
    "simulate {} -o o.npz",
    "inspect {}",
    "identify {} -o o.npz",
    "identify {} --input Fx,Fy --output x -o o.npz",
    "identify rec.npz --design {} -o o.npz",
    "identify multi.npz --design {} -o o.npz",
    "identify rec.npz {} -o o.npz",
    "identify multi.npz {} -o o.npz",
    "plot {} -o o.png",
)
CONTROLLING = (
    "model {} --poles 2 -o o.json",
    "model bla.npz {} --poles 2 -o o.json",
    "orders {}",
    "design {} --bandwidth 5 --sample-time 1e-3 -o o.json",
    "check {} Kc.json",
    "check model.json {}",
    "check matrix.json {}",
    "verify {}",
    "verify cert.json --model {}",
    "verify cert.json --controller {}",
    "prove {} Kc.json",
    "prove model.json {}",
    "export {} -o o.mat",
    "export {} -o o.h",
    "report {} Kc.json -o o.html",
    "report model.json {} -o o.html",
    "report model.json Kc.json --bla {} -o o.html",
    "report model.json Kc.json --record {} -o o.html",
    "report matrix.json K2.json --bla {} -o o.html",
    "report matrix.json K2.json --record {} -o o.html",
    "shape {} --bandwidth 5 -o o.html",
    "servo design {} --period 500 --f-min 8 --f-max 100 --rms 5 -o o.csv",
    "servo play belt {} -o o.csv",
    "servo levels {0} --design {0}",
)
WRONG = {
    "empty.json": "",
    "empty.npz": "",
    "text.csv": "hello\nworld\n",
    "notes.txt": "x",
    "list.json": "[1, 2]",
}
NOT_THERE = ("missing.npz", "missing.json")


def made():
    """One file of every kind, in the folder one is in, and what is none of them; their names."""
    rig, stage = nlfrf.paper_rig(), nlfrf.rig.two_axis_stage()
    ms = nlfrf.multisine(fs=1024, n_samples=1024, f_min=2, f_max=100, rms=0.5, rng=2)
    several = nlfrf.multisine(
        "random-odd", fs=512, n_samples=512, f_min=2, f_max=100, n_inputs=2, rng=1
    )
    record = nlfrf.simulate(rig, ms, n_periods=2)
    multi = nlfrf.simulate(stage, several, n_periods=2, n_discard=2, oversampling=4)
    bla, frm = nlfrf.identify(record), nlfrf.identify(multi)
    model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2))
    matrix = robust.uncertainty(frm, robust.fit_nominal(frm, n_poles=4, dt=1 / 512))
    Kc = control.tf([1e3], [1, 0.1])
    K2 = control.append(*[control.ss([], [], [], [[10.0]], 1 / 512)] * 2)
    for name, content in (("ms", ms), ("ms2", several)):
        nlfrf.save(content, f"{name}.npz")
    for suffix in ("npz", "mat"):
        nlfrf.save(record, f"rec.{suffix}")
        nlfrf.save(multi, f"multi.{suffix}")
    nlfrf.save(bla, "bla.npz")
    nlfrf.save(frm, "frm.npz")
    robust.save(model, "model.json")
    robust.save(matrix, "matrix.json")
    for name, K in (("K", control.tf([1e3], [1e-3, -1e-3], 1e-3)), ("Kc", Kc), ("K2", K2)):
        robust.save(K, f"{name}.json")
    robust.save(robust.check(model, Kc), "cert.json")
    for name, text in WRONG.items():
        Path(name).write_text(text)
    np.savez("plain.npz", a=np.arange(5))
    for folder in ("folder", "dir.npz", "dir.json"):
        Path(folder).mkdir()
    return sorted(os.listdir()) + list(NOT_THERE)


def fault_of(main, arguments):
    """What is wrong with how a command ended; nothing where it answered, or refused in one line."""
    out, err, name = io.StringIO(), io.StringIO(), main.__module__.split(".")[0]
    with mock.patch.object(sys, "argv", [name, *arguments]):
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                main()
            code = 0
        except SystemExit as stop:
            code = stop.code or 0
        except BaseException as error:  # whatever comes through is a traceback to the user
            return f"{type(error).__name__}: {error}"
    said = [
        line
        for line in err.getvalue().splitlines()
        if line.startswith(f"{name}: ") and "warning" not in line
    ]
    if code not in (0, 1, 2) or (code == 2 and len(said) != 1):
        return f"exit code {code}, said {err.getvalue()[-300:]!r}"
    return ""


def attack(n_jobs=None, seed=0):
    """(job, fault) of some jobs or all of them, in a folder of their own."""
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        files = made()
        kept = {name: Path(name).read_bytes() for name in files if Path(name).is_file()}
        jobs = [
            (main, command.format(file))
            for main, commands in ((measuring.main, MEASURING), (controlling.main, CONTROLLING))
            for command in commands
            for file in files
        ]
        order = np.random.default_rng(seed).permutation(len(jobs))[:n_jobs]
        for main, command in (jobs[k] for k in order):
            fault = fault_of(main, command.split())
            changed = [name for name, content in kept.items() if Path(name).read_bytes() != content]
            yield (
                f"{main.__module__.split('.')[0]} {command}",
                fault or f"changed {', '.join(changed)}" * bool(changed),
            )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=None, help="some of them, drawn by chance")
    n = wrong = 0
    for job, fault in attack(parser.parse_args().jobs):
        n += 1
        wrong += bool(fault)
        if fault:
            print(f"{job}: {fault}")
    print(
        f"{n} commands on files of every kind: {wrong} that neither answered nor refused in one"
        " line"
    )
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
