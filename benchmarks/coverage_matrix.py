"""How often the bounds of a matrix hold: entries, whole matrices and new sets, on a two-axis stage.

    python -m benchmarks.coverage_matrix [runs]

The stage: masses 1 and 1.5 kg, modes at 28.9 and 49.8 Hz with 2.1 and 1.5 % damping, coupled by a spring, outputs that
mix the axes; cubic springs, or LuGre friction on both axes at two levels. The truth is the mean over all runs.
"""

from __future__ import annotations

import sys
import warnings

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
RESONANCES = (28.9, 49.8)


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
    """Run one experiment r (2, n) through the stage, under u = r - kp y - kd dy/dt by a sampled controller."""
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
            b1, b2, e1, e2 = rates(x1 + g * v1, x2 + g * v2, w1, w2, z1 + g * d1, z2 + g * d2, u1, u2, cubic, lugre, on)
            q1, q2 = v1 + g * b1, v2 + g * b2
            c1, c2, k1, k2 = rates(x1 + g * w1, x2 + g * w2, q1, q2, z1 + g * e1, z2 + g * e2, u1, u2, cubic, lugre, on)
            m1, m2 = v1 + h * c1, v2 + h * c2
            p1, p2, l1, l2 = rates(x1 + h * q1, x2 + h * q2, m1, m2, z1 + h * k1, z2 + h * k2, u1, u2, cubic, lugre, on)
            x1 += h / 6 * (v1 + 2 * w1 + 2 * q1 + m1)
            x2 += h / 6 * (v2 + 2 * w2 + 2 * q2 + m2)
            v1 += h / 6 * (a1 + 2 * b1 + 2 * c1 + p1)
            v2 += h / 6 * (a2 + 2 * b2 + 2 * c2 + p2)
            z1 += h / 6 * (d1 + 2 * e1 + 2 * k1 + l1)
            z2 += h / 6 * (d2 + 2 * e2 + 2 * k2 + l2)


def stage_record(ms, *, friction=False, linear=False, snr=np.inf, gains=(0.0, 0.0), rng=None, n_discard=3):
    """A `MultiRecord` of the stage: in open loop, or by reference where there are gains; snr [dB] at the output."""
    rng = np.random.default_rng(rng)
    M, total = ms.n_experiments, (PERIODS + n_discard) * N
    r = np.tile(ms.u, (1, 1, PERIODS + n_discard))
    u, y = np.empty((2, 2, M, total))
    cubic = np.zeros(3) if friction or linear else CUBIC
    closed = any(gains)
    kp, kd = (gain * np.array([1.0, 2.0]) for gain in gains)
    # 1 V rms of output needs no scale: the noise of a level comes from the linear stage
    level = 0.0 if np.isinf(snr) else 10 ** (-snr / 20)
    for m in range(M):
        noise = np.zeros((2, total))
        for _ in range(2 if level else 1):
            drive(r[:, m], noise, cubic, LUGRE, friction, kp, kd, u[:, m], y[:, m], 8)
            if level and not noise.any():
                noise = level * y[:, m, n_discard * N :].std(axis=1)[:, None] * rng.standard_normal((2, total))
                if not closed:
                    y[:, m] += noise
                    break

    def cut(s):
        return s[..., n_discard * N :].reshape(2, M, PERIODS, N)

    reference = {"r": cut(r)} if closed else {}
    if not closed:
        u = r
    return nlfrf.MultiRecord(u=cut(u), y=cut(y), fs=FS, lines=ms.lines, **reference)


def tally(frms, clean, near=3.0):
    """Coverage [%] of entries (all, near a resonance), matrices, new sets (entries, matrices), and the median width."""
    truth = np.mean([frm.G for frm in frms], axis=0)
    n = len(frms)
    close = np.any(np.abs(frms[0].f[:, None] - np.array(RESONANCES)) < near, axis=1)
    spread = np.sqrt(np.mean([np.abs(frm.G - truth) ** 2 for frm in frms], axis=0) * 3.0)  # F(2, inf) at 95 %
    rows = []
    for e, frm in enumerate(frms):
        # the others' mean: the run itself is not part of its truth
        d = (frm.G - truth) * n / (n - 1)
        # a new set, as the machine meets it: without measurement noise, and with the scatter of one set
        new = (clean[(e + 1) % n] - truth) * frm.n_realizations**0.5 - (frm.G - truth)
        inside, inside_new = np.abs(d) < frm.bound(), np.abs(new) < frm.bound(of="realization")
        rows.append(
            [
                inside.mean(),
                inside[..., close].mean() if close.any() else np.nan,
                held(frm, d, "bla").mean(),
                inside_new.mean(),
                held(frm, new, "realization").mean(),
                np.median(frm.bound() / spread),
            ]
        )
    rows = np.array(rows)
    return np.concatenate([100 * rows[:, :5].mean(axis=0), [np.median(rows[:, 5])]]), 100 * rows[:, :5].std(
        axis=0
    ) / n**0.5


def held(frm, d, of):
    """(F,) whether d (n_y, n_u, F) lies in the block of the matrix."""
    left, right = frm.block(of=of)
    Z = np.linalg.solve(np.moveaxis(left, 2, 0), np.moveaxis(d, 2, 0)) @ np.linalg.inv(np.moveaxis(right, 2, 0))
    return np.linalg.norm(Z, 2, (1, 2)) <= 1


def static_record(ms, snr=np.inf, rng=None):
    """A `MultiRecord` of static polynomials of two or three inputs."""
    rng = np.random.default_rng(rng)
    u = np.repeat(ms.u[:, :, None], PERIODS, axis=2)
    a, b, c = u[0], u[1], u[-1]
    y = np.stack([a + 0.3 * b + 0.1 * a**3 + 0.1 * a * b**2, b - 0.2 * c + 0.1 * b**2 * c + 0.05 * c**3 + 0.1 * a * b])
    noise = (
        0.0
        if np.isinf(snr)
        else 10 ** (-snr / 20) * rng.standard_normal(y.shape) * y.std(axis=(1, 2, 3))[:, None, None, None]
    )
    return nlfrf.MultiRecord(u=u, y=y + noise, fs=ms.fs, lines=ms.lines)


def played(kind, fs, n_samples, *, f_min, f_max, rng, **more):
    """An orthogonal multisine on the same lines in every run: the truth is a mean over runs."""
    band = {"fs": fs, "n_samples": n_samples, "f_min": f_min, "f_max": f_max}
    grid = nlfrf.multisine(kind, **band, rng=0).lines
    return nlfrf.multisine("custom", lines=grid, **band, rng=rng, **more)


def cases():
    """Name and what makes the record of run e."""

    def stage(kind, R, rms, **more):
        def make(e, **other):
            ms = played(kind, FS, N, **BAND, rms=rms, n_inputs=2, n_realizations=R, rng=e)
            return stage_record(ms, rng=e, **{**more, **other})

        return make

    def static(kind, n_u, R, **more):
        def make(e, **other):
            ms = played(kind, 512, 512, f_min=1, f_max=200, n_inputs=n_u, n_realizations=R, rng=e)
            return static_record(ms, rng=e, **{**more, **other})

        return make

    loop = {"gains": (2000.0, 15.0)}
    for kind in ("random-odd", "special-odd"):
        for R in (1, 2):
            for name, rms, friction in (
                ("springs", (1.0, 1.5), False),
                ("friction", (0.6, 0.8), True),
                ("friction", (3.0, 4.0), True),
            ):
                for snr in (np.inf, 40, 20):
                    yield (
                        f"{kind:12} {name:8} {rms[0]:3g} N  R={R} {snr:4g} dB open",
                        stage(kind, R, rms, friction=friction, snr=snr),
                    )
        for name, rms, friction in (("springs", (1.0, 1.5), False), ("friction", (0.6, 0.8), True)):
            for snr in (np.inf, 40, 20):
                yield (
                    f"{kind:12} {name:8} {rms[0]:3g} N  R=1 {snr:4g} dB loop",
                    stage(kind, 1, rms, friction=friction, snr=snr, **loop),
                )
        for n_u in (2, 3):
            for R in (1, 2):
                for snr in (np.inf, 20):
                    yield f"{kind:12} static   n_u={n_u} R={R} {snr:4g} dB open", static(kind, n_u, R, snr=snr)


def quiet(make, e):
    """The matrix of the same run without noise."""
    return nlfrf.identify(make(e, snr=np.inf), transient="none").G


def main(runs=150, only=""):
    """Print the table."""
    warnings.simplefilter("ignore", nlfrf.DataWarning)
    print(f"{runs} runs each; coverage in % +- standard error over runs, at 95 %")
    print(f"{'':44}  entries   near res.  matrix    new: entry  matrix   width")
    for name, make in cases():
        if only and only not in name:
            continue
        frms = [nlfrf.identify(make(e)) for e in range(runs)]
        clean = [frm.G for frm in frms] if "inf dB" in name else [quiet(make, e) for e in range(runs)]
        found, error = tally(frms, clean)
        cells = "  ".join(f"{a:5.1f}+-{b:3.1f}" for a, b in zip(found[:5], error, strict=True))
        print(f"{name:44}  {cells}  {found[5]:5.2f}", flush=True)


if __name__ == "__main__":
    main(*(int(a) if a.isdigit() else a for a in sys.argv[1:]))
