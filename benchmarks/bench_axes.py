"""Rigs of several axes, attacked: random machines left alone only lose energy, and finer steps do
not change them.

    python -m benchmarks.bench_axes [machines]

Then the two-axis stage against the integrator of `coverage_matrix`, written for that stage alone:
agreement and time.
"""

from __future__ import annotations

import sys
import time
import warnings

import numpy as np

from benchmarks import coverage_matrix
from nlfrf import multisine, simulate
from nlfrf.friction import Coulomb, Dahl, GeneralizedMaxwellSlip, Leuven, LuGre, VaryingSliders
from nlfrf.rig import Rig, run, two_axis_stage

FS = 2048.0
PUSHED, ALONE = 256, 1024  # samples


def some_law(rng):
    """A friction law, or none, of some strength."""
    Fc = 10 ** rng.uniform(-0.7, 0.7)
    Fs, K0, shares = Fc * rng.uniform(1, 1.5), 10 ** rng.uniform(4, 5.3), rng.dirichlet(np.ones(3))
    stribeck = {"Fc": Fc, "Fs": Fs, "vs": 10 ** rng.uniform(-3, -1)}
    return [
        None,
        Coulomb(**stribeck),
        Dahl(sigma0=K0, Fc=Fc),
        LuGre(sigma0=K0, sigma1=0.1 * K0**0.5, sigma2=rng.uniform(0, 1), **stribeck),
        Leuven(curve=Leuven().curve.__class__(K0=K0, Fy=1.01 * Fs), **stribeck),
        GeneralizedMaxwellSlip(stiffness=K0 * shares, alpha=shares, C=100.0, **stribeck),
        VaryingSliders(
            stiffness=K0 * shares, strength=Fc * shares, stiction=1.3, vs=stribeck["vs"]
        ),
    ][rng.integers(7)]


def some_machine(rng):
    """One to four axes: any mass matrix, springs to ground and between axes, some of them cubic,
    gyroscopic damping.
    """
    n = int(rng.integers(1, 5))
    R = rng.standard_normal((n, n))
    mass = np.diag(10 ** rng.uniform(-0.5, 0.5, n)) + 0.2 * R @ R.T
    S = rng.standard_normal((n, n))
    D = rng.standard_normal((n, n))
    gyro = rng.standard_normal((n, n))
    stiffness = 1e4 * (np.diag(10 ** rng.uniform(0, 1, n)) + S @ S.T)
    damping = D @ D.T + 10 * (gyro - gyro.T)
    cubic = np.triu(10 ** rng.uniform(6, 9, (n, n)))
    laws = [some_law(rng) for _ in range(n)]
    return Rig(
        mass,
        stiffness,
        laws,
        damping,
        cubic=cubic + np.triu(cubic, 1).T if rng.random() < 0.5 else None,
    )


def finely(rig, force, steps):
    """Two motions, with so many steps a sample or as many as sliding needs, and with four times as
    many.
    """
    for finer in (1, 2, 4, 8, 16, 32):
        try:
            return [
                run(rig, force, fs=FS, oversampling=n * finer * steps, hold="zoh") for n in (1, 4)
            ]
        except ValueError as error:
            refusal = error
    raise refusal


def energy(rig, motion):
    """(n,) energy of masses and springs, and that which the friction could have stored besides (a
    bound).
    """
    x, v = motion.x, motion.v
    held = (
        np.einsum("in,ij,jn->n", v, rig.mass, v) + np.einsum("in,ij,jn->n", x, rig.stiffness, x)
    ) / 2
    if rig.cubic is not None:
        apart = x[:, None] - x[None]
        held = (
            held
            + np.einsum("ij,ijn->n", np.triu(rig.cubic, 1), apart**4) / 4
            + np.diag(rig.cubic) @ x**4 / 4
        )
    return held


def stored(rig):
    """Energy that bristles and elements can hold at most [J]: strength times its reach, a generous
    factor two.
    """
    found = 0.0
    for law in rig.friction:
        if law is None or isinstance(law, Coulomb):
            continue
        if isinstance(law, GeneralizedMaxwellSlip | VaryingSliders):
            top = law.Fs if isinstance(law, GeneralizedMaxwellSlip) else float(law.strength.sum())
            found += top**2 / float(law.stiffness.sum())
        else:
            K0 = law.curve.K0 if isinstance(law, Leuven) else law.sigma0
            found += (
                law.curve.Fy if isinstance(law, Leuven) else getattr(law, "Fs", law.Fc)
            ) ** 2 / K0
    return 2 * found


def attack(seed):
    """How much energy a random machine gained when left alone (of its largest), and what halving
    its step changed.
    """
    rng = np.random.default_rng(seed)
    rig = some_machine(rng)
    force = np.zeros((rig.n_inputs, PUSHED + ALONE))
    force[:, :PUSHED] = 10 ** rng.uniform(0, 1.5) * rng.standard_normal((rig.n_inputs, PUSHED))
    coarse, fine = finely(rig, force, 4 * int(np.ceil(1 / (FS * rig.stable_step))))
    alone = energy(rig, fine)[PUSHED:]
    gained = (
        max(float((alone - np.minimum.accumulate(alone)).max()) - stored(rig), 0.0) / alone.max()
    )
    return gained, np.abs(coarse.x - fine.x).max() / np.abs(fine.x).max(), rig


def against_the_other_integrator():
    """Agreement and time of the stage with friction and with springs."""
    for kind, rms in (("friction", (0.6, 0.8)), ("friction", (3.0, 4.0)), ("springs", (1.0, 1.5))):
        ms = multisine(
            "random-odd",
            fs=1024,
            n_samples=4096,
            **coverage_matrix.BAND,
            rms=rms,
            n_inputs=2,
            rng=1,
        )
        exact = simulate(
            two_axis_stage(kind), ms, n_periods=2, n_discard=3, hold="zoh", oversampling=64
        ).y
        options = {"friction": kind == "friction", "snrs": (np.inf,)}
        next(coverage_matrix.stage_records(ms, **options))
        begin = time.process_time()
        theirs = next(coverage_matrix.stage_records(ms, **options)).y
        spent = time.process_time() - begin
        print(
            f"  {kind} at {rms} N: coverage_matrix, 8 steps {off(theirs, exact):.1e} in"
            f" {1e3 * spent:.0f} ms",
            end="",
        )
        for steps in (8, 4, 2):
            begin = time.process_time()
            ours = simulate(
                two_axis_stage(kind), ms, n_periods=2, n_discard=3, hold="zoh", oversampling=steps
            ).y
            print(
                f"; ours, {steps}: {off(ours, exact):.1e} in"
                f" {1e3 * (time.process_time() - begin):.0f} ms",
                end="",
            )
        print()


def off(y, exact):
    """Largest difference over the largest value."""
    return np.abs(y - exact).max() / np.abs(exact).max()


def main():
    """Both."""
    warnings.simplefilter("ignore")
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    found = [attack(seed) for seed in range(n)]
    gained, changed = (np.array([one[i] for one in found]) for i in (0, 1))
    print(
        f"{n} random machines: energy gained when left alone, largest {gained.max():.1e} (seed"
        f" {gained.argmax()})"
    )
    many = np.count_nonzero(changed > 1e-3)
    print(
        f"  a step a quarter as long changes the motion by {np.median(changed):.1e} (median), 1e-3"
        f" or more in {many}"
    )
    for seed in np.argsort(changed)[-5:]:
        names = [type(law).__name__ for law in found[seed][2].friction]
        print(f"    seed {seed}: {changed[seed]:.1e}, {', '.join(names)}")
    against_the_other_integrator()


if __name__ == "__main__":
    main()
