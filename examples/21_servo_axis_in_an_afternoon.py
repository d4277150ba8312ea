"""
21. A servo axis in an afternoon: from the traces of its drive to gains with a proof
====================================================================================

The axis is a simulated linear motor of 12 kg under a drive at 4 kHz, with friction that sticks. Set
points and traces are files. With your own machine, your drive plays and records them.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt

import nlfrf
import robust
from nlfrf.io import load_trace
from nlfrf.signals import AxisLimits
from robust import servo
from robust.servo import design_experiment, design_ramp, find_levels, play_experiment

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument(
    "--out", type=Path, default=Path("demo/21"), help="folder for files and pictures"
)
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

# %%
# Given: mass and force constant from the data sheet, and soft gains with which the axis stands
# still.
machine = nlfrf.servo_axis("linear motor")
machine = replace(machine, drive=replace(machine.drive, kv=20, kp=40, tn=0.05))
rough = nlfrf.rig.ServoAxis(motor_inertia=12, drive=machine.drive)
limits = AxisLimits(force=1000, velocity=0.5, travel=0.6)


def play(experiment, name, axis=machine):
    """Write the set points, let the drive play them, and read its trace; the design stands beside
    the set points.
    """
    nlfrf.save(experiment, out / f"{name}.csv")
    play_experiment(axis, out / f"{name}.csv", out / f"{name}-trace.csv")
    return load_trace(
        out / f"{name}-trace.csv", out / f"{name}.npz", u="force set point", y="position"
    )


# %%
# The pre-test: one multisine at rising levels shows the levels that stick, bend and slide.
period = {"fs": 4000, "n_samples": 4000}
ramp = design_ramp(rough, nlfrf.multisine(**period, f_min=4, f_max=100, rng=1), limits=limits)
levels = find_levels(play(ramp, "ramp"), ramp)
print(levels)

# %%
# The experiments. At rest: two levels that stick, one that bends, one that slides. In motion: one
# at 0.1 m/s, where friction slides all the time.
sticks, bends, slides = levels.records
wanted = (
    (sticks, levels.rms[0]),
    (sticks, 4 * levels.rms[0]),
    (bends, levels.rms[1]),
    (slides, levels.rms[2]),
)
slow, fast = (
    nlfrf.multisine(**period, f_min=5, f_max=98, rng=2),
    nlfrf.multisine(**period, f_min=5, f_max=400, rng=3),
)
at_rest = [design_experiment(source, slow, rms=rms) for source, rms in wanted]
moving = design_experiment(rough, fast, rms=60, base_velocity=0.1, strokes=1, limits=limits)
experiments = {f"rest{k + 1}": experiment for k, experiment in enumerate(at_rest)} | {
    "moving": moving
}
for name, experiment in experiments.items():
    play(experiment, name)

# %%
# The gains that the autotuner of the drive proposes, on one page.
proposed = replace(machine.drive, kv=250, kp=290, tn=0.004)
traces = [out / f"{name}-trace.csv" for name in experiments]
records, names, conditions = servo.read_experiments(
    traces, list(experiments.values()), proposed, u="force set point", y="position"
)
before = servo.check(records, proposed, names=names, conditions=conditions)
print(f"\n--- the gains of the autotuner ---\n{before}")

# %%
# Gains with more margin: ``|S|`` below 1.8 on the FRF in motion, the reset time chosen, then read
# back as gains.
PI = robust.shaping.pid(1.0, 1 / 0.03, dt=1 / 4000)
design = robust.design_frf(
    nlfrf.identify(records[-1]), "PD", M_S=1.8, fixed=PI, dt=1 / 4000, filter_time=0.14e-3
)
better = servo.gains_from_controller(
    design.K, like=proposed, output_unit="N"
).alternative  # the faster position loop
after = servo.check(records, better, names=names, conditions=conditions, fit=before.friction.fit)
print(f"\n--- gains with more margin ---\n{after}")

# %%
# For the drive or a PLC: the same cascade as a function block.
(out / "FB_Axis.st").write_text(servo.structured_text(better, name="FB_Axis"))

# %%
# A year later the friction has doubled. In motion the machine still fits the model. The levels at
# rest show the change: the proof still holds if K0 and stiction are below its assumptions, but the
# bound grows.
law = machine.motor_friction
worn = replace(
    machine, motor_friction=replace(law, strength=tuple(2 * force for force in law.strength))
)
print("\n--- in motion, after the friction doubled ---")
print(robust.validate(nlfrf.identify(records[-1]), nlfrf.identify(play(moving, "later", worn)[-1])))
later = [play(experiment, f"later{k + 1}", worn)[0] for k, experiment in enumerate(at_rest)]
friction, read_later = after.friction, robust.friction.identify_friction(later, free=True)
print(f"\n--- at rest, after the friction doubled ---\n{read_later}")
bound, (proof,) = 1e6 * friction.error_bound, friction.assumed.friction
grown = read_later.interval("Fs")[1] / friction.largest
print(
    f"proved up to K0 = {proof.K0:.4g} N/m and stiction {proof.stiction:g}, whatever the force;"
    " eventually at most"
)
print(f"{bound:.3g} um off with the force read before, {bound * grown:.3g} um with that read later")

# %%
# The picture: the levels of the pre-test, and a step of the position set point with both sets of
# gains.
figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.5), layout="constrained")
left.loglog(1e6 * levels.position_rms, levels.stiffness / 1e6, "o-")
left.set(
    xlabel="position [um rms]",
    ylabel="stiffness [N/um]",
    title="pre-test: friction sticks, bends, slides",
)
for name, found in (("autotuner", before), ("more margin", after)):
    right.plot(1e3 * found.step.t, found.step.y, label=f"{name}: {found.settings.kp:.0f} A/(m/s)")
right.set(
    xlabel="time [ms]",
    ylabel="position [set point]",
    title="step of the position set point",
    xlim=(0, 30),
)
right.legend()
for ax in (left, right):
    ax.grid(True, which="both", alpha=0.2)
figure.savefig(out / "axis.png", dpi=120)
