"""Compile the kernels that most tests use, so that not every process does: python -m
tests.support.compiled.
"""

import control
import numpy as np

import nlfrf
from nlfrf.rig import Rig, run, two_axis_stage


def compile_kernels():
    """Run once what a kernel is compiled for: open and closed loops, a stage, a drive, friction
    along a motion.
    """
    ms = nlfrf.multisine(fs=1024, n_samples=256, f_min=8, f_max=100, rng=1)
    several = nlfrf.multisine(
        "random-odd", fs=512, n_samples=256, f_min=2, f_max=100, n_inputs=2, rng=1
    )
    lugre = nlfrf.friction.LuGre(sigma0=64e3, sigma1=80.0, sigma2=0.0, Fc=0.7, Fs=1.0, vs=0.01)
    for rig in (nlfrf.paper_rig(), Rig(1.0, 80e3, lugre)):
        nlfrf.simulate(rig, ms, n_periods=2)
        run(rig, np.zeros(20), control.ss([], [], [], [[1.0]], 1e-3))
    nlfrf.simulate(two_axis_stage(), several, n_periods=2, n_discard=1, oversampling=4)
    run(two_axis_stage("none"), np.zeros((2, 20)), control.ss([], [], [], np.eye(2), 1e-3))
    run(nlfrf.servo_axis("linear motor"), np.zeros(20))
    sliders, still = nlfrf.friction.VaryingSliders(stiffness=[1.0], strength=[2.0]), np.zeros(20)
    nlfrf.friction.element_forces(sliders, still, still, fs=1000.0)
    nlfrf.friction.load_forces(
        sliders, still, still, mass=1.0, stiffness=1.0, damping=1.0, viscous=0.0, fs=1000.0
    )


if __name__ == "__main__":
    compile_kernels()
