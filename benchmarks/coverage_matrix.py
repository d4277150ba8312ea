"""How often the bounds of a matrix hold: entries, whole matrices and new sets, on a two-axis stage.

    python -m benchmarks.coverage_matrix [runs] [part of a row's name]

The stage: masses 1 and 1.5 kg, modes at 28.9 and 49.8 Hz with 2.1 and 1.5 % damping, coupled by a
spring, outputs that mix the axes; cubic springs, or LuGre friction on both axes at two levels; and
static polynomials of two and three inputs. The truth is the mean over all runs. Asked for: 93 (less
three standard errors over runs) to 99.8 %, a width of at most 1.5 (the median bound over that of a
known scatter); a cell that misses is marked.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator

import numba
import numpy as np

import nlfrf

FS, N, PERIODS = 1024.0, 4096, 2
MASS = np.array([1.0, 1.5])
STIFFNESS = np.array([0.8 * (2 * np.pi * 28) ** 2, 1.5 * (2 * np.pi * 48) ** 2])
COUPLING, DAMPING = 9e3, np.array([6.0, 12.0, 2.0])
CUBIC = np.array([3.3e10, 1.2e11, 4.5e10])
LUGRE = np.array([3e4, 13.0, 0.4, 0.7, 1.0, 0.01])
MIX = np.array([[1.0, 0.15], [-0.1, 1.0]])
BAND = {"f_min": 9 * FS / N, "f_max": 400 * FS / N}
RESONANCES, NEAR = (28.9, 49.8), 3.0
SNRS = (np.inf, 40.0, 20.0)
GAINS = (2000.0, 15.0)  # of position and velocity, twice as large on the second axis


@numba.njit(cache=True, fastmath=True)
def rates(x1, x2, v1, v2, z1, z2, u1, u2, cubic, lugre, on):
    """Accelerations of both axes, and how fast their bristles bend."""
    apart = x1 - x2
    inner = COUPLING * apart + cubic[2] * apart**3 + DAMPING[2] * (v1 - v2)
    f1 = u1 - STIFFNESS[0] * x1 - cubic[0] * x1**3 - DAMPING[0] * v1 - inner
    f2 = u2 - STIFFNESS[1] * x2 - cubic[1] * x2**3 - DAMPING[1] * v2 + inner
    d1 = d2 = 0.0
    if on:
        s0, s1, s2, Fc, Fs, vs = lugre
        d1 = v1 - s0 * abs(v1) / (Fc + (Fs - Fc) * np.exp(-((v1 / vs) ** 2))) * z1
        d2 = v2 - s0 * abs(v2) / (Fc + (Fs - Fc) * np.exp(-((v2 / vs) ** 2))) * z2
        f1 -= s0 * z1 + s1 * d1 + s2 * v1
        f2 -= s0 * z2 + s1 * d2 + s2 * v2
    return f1 / MASS[0], f2 / MASS[1], d1, d2


@numba.njit(cache=True, fastmath=True)
def drive(r, noise, cubic, lugre, on, kp, kd, u_out, y_out, substeps):
    """Run one experiment r (2, n) through the stage, under u = r - kp y - kd dy/dt by a sampled
    controller.
    """
    h = 1.0 / FS / substeps
    x1 = x2 = v1 = v2 = z1 = z2 = before1 = before2 = 0.0
    for t in range(r.shape[1]):
        y1 = MIX[0, 0] * x1 + MIX[0, 1] * x2 + noise[0, t]
        y2 = MIX[1, 0] * x1 + MIX[1, 1] * x2 + noise[1, t]
        u1 = r[0, t] - kp[0] * y1 - kd[0] * (y1 - before1) * FS
        u2 = r[1, t] - kp[1] * y2 - kd[1] * (y2 - before2) * FS
        before1, before2 = y1, y2
        u_out[0, t], u_out[1, t], y_out[0, t], y_out[1, t] = u1, u2, y1, y2
        for _ in range(substeps):
            a1, a2, d1, d2 = rates(x1, x2, v1, v2, z1, z2, u1, u2, cubic, lugre, on)
            g = h / 2
            w1, w2 = v1 + g * a1, v2 + g * a2
            b1, b2, e1, e2 = rates(
                x1 + g * v1, x2 + g * v2, w1, w2, z1 + g * d1, z2 + g * d2, u1, u2, cubic, lugre, on
            )
            q1, q2 = v1 + g * b1, v2 + g * b2
            c1, c2, k1, k2 = rates(
                x1 + g * w1, x2 + g * w2, q1, q2, z1 + g * e1, z2 + g * e2, u1, u2, cubic, lugre, on
            )
            m1, m2 = v1 + h * c1, v2 + h * c2
            p1, p2, l1, l2 = rates(
                x1 + h * q1, x2 + h * q2, m1, m2, z1 + h * k1, z2 + h * k2, u1, u2, cubic, lugre, on
            )
            x1 += h / 6 * (v1 + 2 * w1 + 2 * q1 + m1)
            x2 += h / 6 * (v2 + 2 * w2 + 2 * q2 + m2)
            v1 += h / 6 * (a1 + 2 * b1 + 2 * c1 + p1)
            v2 += h / 6 * (a2 + 2 * b2 + 2 * c2 + p2)
            z1 += h / 6 * (d1 + 2 * e1 + 2 * k1 + l1)
            z2 += h / 6 * (d2 + 2 * e2 + 2 * k2 + l2)


def stage_records(
    ms, *, friction=False, linear=False, gains=(0.0, 0.0), snrs=SNRS, rng=None, n_discard=3
):
    """`Record`s of one run of the stage, one for each snr [dB]; by reference where there are
    gains.
    """
    rng = np.random.default_rng(rng)
    M, total = ms.n_experiments, (PERIODS + n_discard) * N
    r = np.tile(ms.u, (1, 1, PERIODS + n_discard))
    cubic = np.zeros(3) if friction or linear else CUBIC
    closed = any(gains)
    kp, kd = (gain * np.array([1.0, 2.0]) for gain in gains)

    def run(noise):
        """Inputs and outputs of all experiments under noise that the controller sees."""
        u, y = np.empty((2, 2, M, total))
        for m in range(M):
            run(r[:, m], noise[:, m], cubic, LUGRE, friction, kp, kd, u[:, m], y[:, m], 8)
        return u, y

    def cut(s):
        return s[..., n_discard * N :].reshape(2, M, PERIODS, N)

    def record(u, y):
        signals = {"u": cut(u), "r": cut(r)} if closed else {"u": cut(r)}
        return nlfrf.Record(**signals, y=cut(y), fs=FS, lines=ms.lines)

    u, quiet = run(np.zeros((2, M, total)))
    noise = quiet[..., n_discard * N :].std(axis=2)[..., None] * rng.standard_normal(quiet.shape)
    for snr in snrs:
        if np.isinf(snr):
            yield record(u, quiet)
        elif closed:
            yield record(*run(10 ** (-snr / 20) * noise))
        else:
            yield record(r, quiet + 10 ** (-snr / 20) * noise)


def static_record(ms, snr=np.inf, rng=None):
    """A `Record` of static polynomials of two or three inputs."""
    rng = np.random.default_rng(rng)
    u = np.repeat(ms.u[:, :, None], PERIODS, axis=2)
    a, b, c = u[0], u[1], u[-1]
    y = np.stack(
        [
            a + 0.3 * b + 0.1 * a**3 + 0.1 * a * b**2,
            b - 0.2 * c + 0.1 * b**2 * c + 0.05 * c**3 + 0.1 * a * b,
        ]
    )
    noise = (
        0.0
        if np.isinf(snr)
        else 10 ** (-snr / 20)
        * rng.standard_normal(y.shape)
        * y.std(axis=(1, 2, 3))[:, None, None, None]
    )
    return nlfrf.Record(u=u, y=y + noise, fs=ms.fs, lines=ms.lines)


def tally(frms, quiet, resonances):
    """(runs, 9) coverages: entries, matrices, entries and matrices of a new set, all lines and
    near; then widths.
    """
    truth = np.mean([frm.G for frm in frms], axis=0)
    n, f = len(frms), frms[0].f
    near = np.any(np.abs(f[:, None] - np.array(resonances)) < NEAR, axis=1)
    spread = np.sqrt(
        np.mean([np.abs(frm.G - truth) ** 2 for frm in frms], axis=0) * 3.0
    )  # F(2, inf) at 95 %
    rows = []
    for e, frm in enumerate(frms):
        # the others' mean: the run itself is not part of its truth
        d = (frm.G - truth) * n / (n - 1)
        # a new set, as the machine meets it: without measurement noise, and with the scatter of one
        # set
        new = (quiet[(e + 1) % n] - truth) * frm.experiment.n_realizations**0.5 - (frm.G - truth)
        row = []
        for apart, of in ((d, "bla"), (new, "realization")):
            for inside in (np.abs(apart) < frm.bound(of=of), held(frm, apart, of)):
                row += [inside.mean(), inside[..., near].mean() if near.any() else np.nan]
        rows.append([*row, np.median(frm.bound() / spread)])
    return np.array(rows)


def held(frm, d, of):
    """(F,) whether d (n_y, n_u, F) lies in the block of the matrix."""
    left, right = frm.block(of=of)
    Z = np.linalg.solve(np.moveaxis(left, 2, 0), np.moveaxis(d, 2, 0)) @ np.linalg.inv(
        np.moveaxis(right, 2, 0)
    )
    return np.linalg.norm(Z, 2, (1, 2)) <= 1


def played(kind, fs, n_samples, *, f_min, f_max, rng, **more):
    """An orthogonal multisine on the same lines in every run: the truth is a mean over runs."""
    band = {"fs": fs, "n_samples": n_samples, "f_min": f_min, "f_max": f_max}
    grid = nlfrf.multisine(kind, **band, rng=0).lines
    return nlfrf.multisine("custom", lines=grid, **band, rng=rng, **more)


MACHINES = {
    "springs  1.0 N": ((1.0, 1.5), False),
    "friction 0.6 N": ((0.6, 0.8), True),
    "friction 3.0 N": ((3.0, 4.0), True),
}


def groups() -> Iterator[tuple[str, Callable[[int], Iterator[nlfrf.Record]]]]:
    """Name of each group of rows, and what makes the records of run e, one for each level of
    noise.
    """

    def stage(kind, R, rms, friction, design="orthogonal", **more):
        def make(e):
            ms = played(
                kind, FS, N, **BAND, rms=rms, n_inputs=2, n_realizations=R, design=design, rng=e
            )
            return stage_records(ms, friction=friction, rng=e, **more)

        return make

    def static(kind, n_u, R):
        def make(e):
            ms = played(kind, 512, 512, f_min=1, f_max=200, n_inputs=n_u, n_realizations=R, rng=e)
            return (static_record(ms, snr, rng=e) for snr in SNRS)

        return make

    for kind in ("special-odd", "random-odd"):
        for n_u, R in ((2, 2), (3, 1), (3, 2), (2, 1)):
            yield f"{kind:11} static n_u={n_u}     R={R} open", static(kind, n_u, R)
        for R in (2, 1):
            for name, (rms, friction) in MACHINES.items():
                yield f"{kind:11} {name} R={R} loop", stage(kind, R, rms, friction, gains=GAINS)
                yield f"{kind:11} {name} R={R} open", stage(kind, R, rms, friction)
    for R in (1, 2):
        for name, (rms, friction) in MACHINES.items():
            yield (
                f"zippered    {name} R={R} open",
                stage("random-odd", R, rms, friction, design="zippered"),
            )


def main(runs=150, only=""):
    """Print the table."""
    if runs < 2:
        raise SystemExit(f"runs must be at least 2, the truth is their mean, got {runs}")
    warnings.simplefilter("ignore", nlfrf.DataWarning)
    print(
        f"{runs} runs each; coverage in % (standard error over runs) at 95 %, all lines, then near"
        " the resonances"
    )
    heads = ("entries", "near", "matrix", "near", "new: entries", "near", "matrix", "near")
    print(" " * 46 + "  ".join(f"{head:12}" for head in heads) + "  width")
    missed = rows = 0
    for name, make in groups():
        if only and only not in name:
            continue
        # columns of noise levels; the first is without noise
        frms = list(
            zip(*([nlfrf.identify(record) for record in make(e)] for e in range(runs)), strict=True)
        )
        quiet = [frm.G for frm in frms[0]]
        for snr, some in zip(SNRS, frms, strict=True):
            row = tally(some, quiet, () if "static" in name else RESONANCES)
            mean, error = 100 * row[:, :8].mean(axis=0), 100 * row[:, :8].std(axis=0) / runs**0.5
            width = float(np.median(row[:, 8]))
            bad = (mean < 93 - 3 * error) | (mean > 99.8)
            cells = "  ".join(
                f"{a:5.1f} ({b:3.1f}){'!' if wrong else ' '}"
                for a, b, wrong in zip(mean, error, bad, strict=True)
            )
            print(
                f"{name} {snr:4g} dB  {cells}  {width:5.2f}{'!' if width > 1.5 else ''}", flush=True
            )
            missed, rows = missed + int(bad.any() or width > 1.5), rows + 1
    print(f"{missed} of {rows} rows miss")


if __name__ == "__main__":
    main(*(int(a) if a.isdigit() else a for a in sys.argv[1:]))
