"""
19. A controller designed with a proof for a class of friction
==============================================================

A mass on a spring with friction is identified at four levels. Loop shaping on one level gives two
loops that the check calls statistically robust. A PID is designed with a proof that the machine
comes to rest with every friction of the class read from the levels. All run on the machine with
frictions of the class and kicks from gentle to hard.

The table compares the frequency up to which ``|S|`` is below -3 dB, stuck and sliding, the hardest
kick after which the machine comes to rest, and the oscillation seconds later.
"""

import argparse
import warnings
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from nlfrf.friction import VaryingSliders

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/19"), help="folder for text and picture")
args = parser.parse_args()
args.out.mkdir(parents=True, exist_ok=True)
warnings.filterwarnings("ignore", message="the hysteresis memory", category=nlfrf.DataWarning)

T, LEVELS = 1e-3, (0.1, 0.25, 0.5, 2.5)  # sample time [s]; rms of the force [N]
KICKS = np.geomspace(0.003, 3.0, 16)  # [m/s]
MARKS = {"the rig": "o-", "class 1": "s--", "class 2": "^-."}


def identified(rms):
    """The BLA of the rig at one level, from one special-odd record."""
    ms = nlfrf.multisine(
        "special-odd", fs=4096, n_samples=16384, f_min=1.25, f_max=250, rms=rms, rng=1
    )
    return nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2))


def spring(stiffness):  # with the mass of the machine on it
    return control.ss(control.tf([1], [1 / assumed.machine.B_force[1], 0, stiffness]))


def band(K, stiffness):
    """Return the frequency [Hz] up to which |S| is below -3 dB with a spring; nan if the loop is
    unstable.
    """
    plant = robust.sampled(spring(stiffness), T)
    if np.abs(control.feedback(plant * K).poles()).max() > 1:
        return np.nan
    f = np.geomspace(0.05, 499, 4000)
    S = np.abs(1 / (1 + plant(np.exp(2j * np.pi * f * T)) * K(np.exp(2j * np.pi * f * T))))
    return f[np.flatnonzero(S > 0.7071)[0]]


def laws():
    """Yield the rig, whose creeping friction is outside the class, and frictions of the class, up
    to its stiction.
    """
    yield "the rig", nlfrf.paper_rig()
    rng = np.random.default_rng(0)
    for i in range(2):
        options = {
            "stiction": assumed.friction[0].stiction,
            "vs": 0.003,
            "dwell": 0.02,
            "asymmetry": 0.3 * i,
        }
        stiffness = assumed.friction[0].K0 * rng.dirichlet(np.ones(3))
        strength = rng.dirichlet(np.ones(3))
        sliders = VaryingSliders(stiffness=stiffness, strength=strength, **options)
        yield (
            f"class {i + 1}",
            nlfrf.rig.Rig(1 / assumed.machine.B_force[1], assumed.stiffness_low, sliders),
        )


def shaped(crossover):
    """Return loop shaping on one level, and its verdict by the check there."""
    K = robust.ncfsyn(plant, robust.shaping.crossover_weight(plant, 2 * np.pi * crossover)).K
    return K, robust.check(model, K).verdict


blas = {rms: identified(rms) for rms in LEVELS}
assumed = robust.friction.machine_with_friction(list(blas.values()))
ends = [
    spring(assumed.stiffness_low),
    spring(assumed.stiffness_low + assumed.friction[0].K0),
]  # sliding, and stuck
proved = robust.design_frf(ends, "PID", M_S=2.5, dt=T, filter_time=T / 2, prove=assumed)
model = robust.uncertainty(blas[0.5], robust.fit_nominal(blas[0.5], n_poles=3), order=6)
plant = robust.sampled(model.nominal, T)
found = {f"shaped for {crossover} Hz": shaped(crossover) for crossover in (40, 120)}
found["PID, proved"] = proved.K, robust.check(model, proved.K).verdict
text = [
    str(assumed),
    "",
    str(proved),
    "",
    f"{'':20}{'check':22}{'proof':10}{'band, stuck':>12}{'sliding':>10}",
]
text += [f"{'':20}by friction: hardest kick that comes to rest [m/s], oscillation after it [m]"]
figure, axes = plt.subplots(1, 3, figsize=(15, 4.2), sharey=True, layout="constrained")
for ax, (name, (K, checked)) in zip(axes, found.items(), strict=True):
    proof = robust.prove_friction(assumed.machine, K, assumed.friction, Fs=1.0)
    k = assumed.stiffness_low
    kicks, bands = [], f"{band(K, k + assumed.friction[0].K0):9.3g} Hz{band(K, k):7.3g} Hz"
    for law, rig in laws():
        starts = np.column_stack([np.zeros(KICKS.size), KICKS])
        responses = nlfrf.rig.run_loops(rig, np.zeros(3000), K, initial=starts)
        left = np.array([np.inf if r.diverged else np.ptp(r.x[-1000:]) for r in responses])
        rests = left < 1e-3 * KICKS / np.sqrt(k * assumed.machine.B_force[1])
        first = np.argmin(np.append(rests, False))  # that does not
        hardest = (
            "none" if not first else "all" if first == KICKS.size else f"{KICKS[first - 1]:.2g}"
        )
        kicks.append(f"{law}: {hardest}, {left[:first].max(initial=0):.1g}")
        ax.loglog(KICKS, np.clip(left, 1e-16, 1), MARKS[law], mfc="none", label=law)
    ax.set(
        title=f"{name}: {proof.verdict}",
        xlabel="kick [m/s]",
        ylabel="swing in the third second [m]",
    )
    if np.isfinite(proof.kick_sure):
        ax.axvline(proof.kick_sure, color="k", ls="--", label="surely runs away from here")
    ax.legend(fontsize="small")
    text += [f"{name:20}{checked:22}{proof.verdict:10}{bands}", f"{'':20}{'   '.join(kicks)}"]
    text.append(
        f"{'':20}{proof.reason or 'comes to rest from every state with every friction of the class'}"
    )
figure.savefig(args.out / "designed.png", dpi=110)
(args.out / "designed.txt").write_text("\n".join(text) + "\n")
print("\n".join(text))
