"""
18. A proof for a class of friction, read from three levels
===========================================================

A mass on a spring with friction is identified at three levels. They give the machine while it
slides, and its stiffness while it sticks, and so a class of friction. Each controller with integral
action gets either a proof that the machine comes to rest with every friction of the class, from
every state, or a friction with which it does not. All are then simulated with frictions of the
class, and with the friction of the paper's rig. The rig creeps below break-away and is only in
``Bristle``, for which a PD is proved but no PID.
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
parser.add_argument("--out", type=Path, default=Path("demo/18"), help="folder for text and picture")
args = parser.parse_args()
args.out.mkdir(parents=True, exist_ok=True)
# a decaying motion makes ever smaller nested hysteresis loops; the innermost may be forgotten
warnings.filterwarnings("ignore", message="the hysteresis memory", category=nlfrf.DataWarning)

T, LEVELS = 1e-3, (0.1, 0.25, 2.5)  # sample time [s]; rms of the force [N]


def identified(rms):
    """The BLA of the rig at one level, from one special-odd record."""
    ms = nlfrf.multisine(
        "special-odd", fs=4096, n_samples=16384, f_min=1.25, f_max=250, rms=rms, rng=1
    )
    return nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2))


def pid(Kp, Ki, Kd):
    """Kp + Ki T/(z - 1) + Kd (1 - 1/z)/T, in N/m, N/ms and Ns/m."""
    return control.StateSpace([[1, 0], [0, 0]], [[1], [1]], [[Ki * T, -Kd / T]], [[Kp + Kd / T]], T)


assumed = robust.friction.machine_with_friction([identified(rms) for rms in LEVELS])
text = [str(assumed), ""]

CONTROLLERS = {
    "PID": (pid(20e3, 3e5, 60.0), 0.0),
    "integrator alone": (pid(0.0, 4e5, 0.0), 0.0),
    "too much damping, late": (pid(80e3, 1e5, 240.0), T),
}
proofs = {}
for name, (K, delay) in CONTROLLERS.items():
    proof = proofs[name] = robust.prove_friction(
        assumed.machine, K, assumed.friction, delay=delay, Fs=1.0
    )
    text += [f"--- {name} ---", str(proof), ""]
creeping = robust.friction.Bristle(
    assumed.friction[0].K0, 1 / 0.7, 13.0
)  # what the levels cannot show: stiction, sigma1
PD = control.StateSpace([[0.0]], [[1.0]], [[-60.0 / T]], [[20e3 + 60.0 / T]], T)
for name, K in (
    ("PD, bristles that creep", PD),
    ("PID, bristles that creep", pid(20e3, 3e5, 60.0)),
):
    text += [f"--- {name} ---", str(robust.prove_friction(assumed.machine, K, creeping)), ""]

# Frictions of the class, and kicks: the sliders vary with speed, rest, position and direction.
rng = np.random.default_rng(0)
kicks = np.column_stack([np.zeros(12), np.geomspace(0.01, 1.0, 12)])
figure, axes = plt.subplots(1, len(CONTROLLERS), figsize=(13, 4), layout="constrained")
for ax, (name, (K, delay)) in zip(axes, CONTROLLERS.items(), strict=True):
    law = VaryingSliders(
        stiffness=assumed.friction[0].K0 * rng.dirichlet(np.ones(4)),
        strength=rng.dirichlet(np.ones(4)),
        stiction=assumed.friction[0].stiction,
        vs=0.01,
        dwell=0.05,
        wavelength=1e-4,
        asymmetry=0.3,
    )
    rig = nlfrf.rig.Rig(
        1 / assumed.machine.B_force[1], assumed.stiffness_low, law
    )  # the machine of the proof
    late, still = nlfrf.rig.Controller(K, delay=delay), np.zeros(4000)
    responses = nlfrf.rig.run_loops(rig, still, late, initial=kicks, oversampling=8)
    outside = nlfrf.rig.run_loops(nlfrf.paper_rig(), still, late, initial=kicks)
    for kind, found in (
        ("a friction of the class", responses),
        ("the rig, which creeps: outside the class", outside),
    ):
        moving = sum(r.diverged or np.ptp(r.x[-400:]) > 1e-3 * np.ptp(r.x) for r in found)
        text.append(
            f"{name:23}{proofs[name].verdict:8}{kind:40}{moving:2d} of {len(found)} move after 4 s"
        )
    for response in (responses[0], responses[-1]):
        ax.semilogy(
            response.t,
            np.maximum(np.abs(response.v), 1e-7),
            lw=0.8,
            label=f"kick {response.v[0]:.2g} m/s",
        )
    ax.set(
        xlabel="time [s]",
        ylabel="|velocity| [m/s]",
        title=f"{name}: {proofs[name].verdict}",
        ylim=(1e-7, 1e3),
    )
    ax.legend(fontsize="small")
figure.savefig(args.out / "proof.png", dpi=110)
(args.out / "proof.txt").write_text("\n".join(text) + "\n")
print("\n".join(text))
