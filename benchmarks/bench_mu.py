"""The structured singular value in numbers, beside dkpy and SLICOT (AB13MD) where they are
installed.

python -m benchmarks.bench_mu                          # peers in this environment
python -m benchmarks.bench_mu --peer PYTHON            # peers in another one: the interpreter that has dkpy or slycot
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time

import numpy as np

import robust
from benchmarks.timing import best
from robust import dk_iteration, hinfsyn
from robust.lti.connections import lower_lft
from robust.lti.lti import evaluate_transfer
from robust.mu.gain import gain_bound
from tests.robust.synthesis.test_hinfsyn import random_plant
from tests.support.distillation import WITH_PERFORMANCE, controller, plant

#: Runs in the other interpreter: reads N (61, 4, 4) and writes seconds and values of each peer it
#: finds.
PEER = """
import json, sys, time
import numpy as np
given = np.array(json.load(sys.stdin)["N"])
N = given[..., 0] + 1j * given[..., 1]
said = {}
try:
    import slycot
    begin = time.process_time()
    mu = [float(slycot.ab13md(M, np.array([1, 1, 2]), np.array([2, 2, 2]))[0]) for M in N]
    said["AB13MD (slycot %s)" % slycot.__version__] = [time.process_time() - begin, mu]
except ImportError as error:
    said["AB13MD (slycot)"] = "not installed (%s)" % error
try:
    import dkpy
    blocks = [[1, 1], [1, 1], [2, 2]]
    try:
        blocks = [dkpy.ComplexFullBlock(1, 1), dkpy.ComplexFullBlock(1, 1), dkpy.ComplexFullBlock(2, 2)]
    except AttributeError:
        blocks = np.array(blocks)
    some = N[:: int(sys.argv[1])]
    begin = time.process_time()
    mu = dkpy.SsvLmiBisection(n_jobs=None).compute_ssv(np.moveaxis(some, 0, 2), blocks)[0]
    said["dkpy"] = [(time.process_time() - begin) * len(N) / len(some), [float(m) for m in mu]]
except ImportError as error:
    said["dkpy"] = "not installed (%s)" % error
print(json.dumps(said))
"""


def distillation(peer, every):
    """SP 8.11.3 on 61 frequencies, with the peers."""
    loop = lower_lft(plant(), controller())
    omega = np.geomspace(1e-3, 1e2, 61)
    matrices = evaluate_transfer(loop.A, loop.B, loop.C, loop.D, 1j * omega)
    N = np.moveaxis(matrices, 0, 2)
    mine = robust.mu.upper(N, WITH_PERFORMANCE).value
    seconds = best(lambda: robust.mu.upper(N, WITH_PERFORMANCE))
    print(
        f"robust.mu.upper, SP 8.11.3: 61 frequencies in {1e3 * seconds:.1f} ms,"
        f" {1e3 * seconds / 61:.3f} ms each"
    )
    text = json.dumps({"N": np.stack([matrices.real, matrices.imag], axis=-1).tolist()})
    done = subprocess.run(
        [peer, "-c", PEER, str(every)], input=text, capture_output=True, text=True, check=False
    )
    if done.returncode:
        print(f"  the peers' interpreter failed: {done.stderr.strip().splitlines()[-1]}")
        return
    for name, result in json.loads(done.stdout.strip().splitlines()[-1]).items():
        if isinstance(result, str):
            print(f"  {name}: {result}")
            continue
        theirs = np.array(result[1])
        off = np.max(np.abs((mine if theirs.size == 61 else mine[::every]) / theirs - 1))
        print(
            f"  {name}: {1e3 * result[0]:.1f} ms, {result[0] / seconds:.1f} times as long; off by"
            f" {off:.1e} relative"
        )


def random_family(blocks, W, performance=0):
    """Complex normal matrices for these blocks, with channels of performance behind them."""
    rng = np.random.default_rng(0)
    shape = sum(b[0] for b in blocks) + performance, sum(b[1] for b in blocks) + performance, W
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def random_blocks():
    """Time and agreement of both bounds on random problems; the lower one beside that of 25 times
    as many starts.
    """
    for blocks in (
        [(1, 1)] * 3,
        [(2, 1), (1, 2), (2, 2)],
        [(2, 2, "repeated"), (1, 1)],
        [(2, 2, "repeated"), (2, 2, "repeated")],
        [(3, 3, "repeated"), (2, 2, "repeated"), (1, 1)],
        [(1, 1, "real"), (1, 1), (1, 1)],
        [(1, 1, "real")] * 4,
        [(1, 1, "real")] * 6,
        [(2, 2, "real"), (1, 1), (2, 1)],
        [(2, 2, "real"), (2, 2, "real"), (2, 2)],
        [(2, 2, "real"), (2, 2, "repeated"), (1, 2)],
    ):
        few = random_family(blocks, 30)
        bound = robust.mu.upper(few, blocks).value
        upper = best(lambda few=few, blocks=blocks: robust.mu.upper(few, blocks), 1) / 30
        found = robust.mu.lower(few, blocks).value
        each = best(lambda few=few, blocks=blocks: robust.mu.lower(few, blocks), 1) / 30
        many = np.maximum(found, robust.mu.lower(few, blocks, n_starts=150, rng=1).value)
        print(
            f"{blocks}: upper {1e3 * upper:.2f} ms each, lower {1e3 * each:.1f} ms each; lower over"
            f" upper {(found / bound).min():.3f} at least, {np.median(found / bound):.3f} in the"
            f" middle; over that of many starts {(found / many).min():.4f} at least"
        )


def worst_gains():
    """400 frequencies of the worst gain over a set, its worst case, and how far apart both bounds
    are.
    """
    for blocks in (
        [(2, 2)],
        [(1, 1)] * 4,
        [(2, 2), (2, 2, "repeated")],
        [(1, 1, "real"), (1, 1)],
        [(2, 2, "real"), (1, 1), (2, 1)],
    ):
        N = random_family(blocks, 400, 2)
        rows, cols = (sum(b[k] for b in blocks) for k in (0, 1))
        N = (
            N
            / robust.mu.upper(N[:rows, :cols], blocks).value
            * np.random.default_rng(1).uniform(0.3, 0.9, 400)
        )
        seconds = best(lambda N=N, blocks=blocks: gain_bound(N, blocks), 1)
        begin = time.process_time()
        found = robust.mu.worst_gain(N[:, :, :40], blocks)
        both = time.process_time() - begin
        ratio = found.lower / found.upper
        print(
            f"robust.mu.worst_gain, {blocks}: 400 frequencies in {seconds:.2f} s; with a worst case"
            f" {1e3 * both / 40:.1f} ms each, which has {ratio.min():.3f} of the bound at least,"
            f" {np.median(ratio):.4f} in the middle"
        )


def certificates():
    """Seconds of the proofs between frequencies."""
    loop = lower_lft(plant(), controller())
    for level in (5.79, 5.783, 5.77):
        found = robust.mu.certify(loop, WITH_PERFORMANCE, level)
        seconds = best(lambda level=level: robust.mu.certify(loop, WITH_PERFORMANCE, level), 3)
        print(
            f"robust.mu.certify, mu < {level}: {found.holds}, {len(found.intervals)} intervals, "
            f"{seconds:.2f} s {found.reason}"
        )


def synthesis():
    """Seconds of H-infinity synthesis by number of states, and of D-K iteration on the column."""
    rng = np.random.default_rng(0)
    for n in (5, 10, 20):
        for dt in (0, 0.1):
            P = random_plant(rng, n, 3, 2, 4, 2, dt)
            found = hinfsyn(P, 2, 2)
            seconds = best(lambda P=P: hinfsyn(P, 2, 2), 3)
            kind = "discrete" if dt else "continuous"
            print(
                f"hinfsyn, {n} states, {kind}: {seconds:.2f} s, gamma {found.gamma:.5g} of"
                f" {found.gamma_min:.5g}"
            )
    for order in (2, 4):
        begin = time.process_time()
        design = dk_iteration(plant(), WITH_PERFORMANCE, 2, 2, order=order)
        rounds = ", ".join(f"{mu:.4f}" for _, mu, _ in design.history)
        seconds = time.process_time() - begin
        print(
            f"dk_iteration, SP 8.11.3, order {order}: mu {rounds} in {seconds:.1f} s;"
            f" {design.K.nstates} states"
        )


def main():
    """Everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--peer", default=sys.executable, help="interpreter that has dkpy or slycot"
    )
    parser.add_argument(
        "--every",
        type=int,
        default=6,
        help="dkpy takes seconds a frequency: every so-manieth is timed",
    )
    given = parser.parse_args()
    distillation(given.peer, given.every)
    random_blocks()
    worst_gains()
    certificates()
    synthesis()


if __name__ == "__main__":
    main()
