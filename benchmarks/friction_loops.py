"""Controllers for the rig with friction, from timid to too bold: those of example 14, and random
ones.
"""

from __future__ import annotations

import warnings

import control
import numpy as np

import nlfrf
import robust

T = 1e-3  # sample time [s]


def bla_of_level(rms: float, rig: nlfrf.rig.Rig | None = None) -> nlfrf.Bla:
    """The BLA of the paper's rig at one level [N], from one special-odd record."""
    ms = nlfrf.multisine(
        "special-odd", fs=4096, n_samples=16384, f_min=1.25, f_max=250, rms=rms, rng=1
    )
    return nlfrf.identify(nlfrf.simulate(rig or nlfrf.paper_rig(), ms, n_periods=2, n_discard=2))


def of_example_14() -> list[tuple[control.StateSpace, float]]:
    """(K, delay) of the 240: loop shaping on one level and on three, each with less and with more
    gain.
    """
    blas = {rms: bla_of_level(rms) for rms in (0.25, 0.5, 2.0)}
    found = []
    for levels in ((0.5,), (0.25, 0.5, 2.0)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            plant = robust.sampled(
                robust.fit_nominal([blas[rms] for rms in levels], n_poles=3).G, T
            )
        for crossover in np.geomspace(5, 120, 10):
            K = robust.ncfsyn(
                plant, robust.shaping.crossover_weight(plant, 2 * np.pi * crossover)
            ).K
            found += [
                (control.StateSpace(K.A, K.B, g * K.C, g * K.D, T), 0.0)
                for g in np.geomspace(0.25, 8, 12)
            ]
    return found


def pid_sampled(Kp: float, Ki: float, Kd: float) -> control.StateSpace:
    """K = Kp + Ki T/(z - 1) + Kd (1 - 1/z)/T."""
    return control.StateSpace([[1, 0], [0, 0]], [[1], [1]], [[Ki * T, -Kd / T]], [[Kp + Kd / T]], T)


def random_loops(n: int, seed: int) -> list[tuple[control.StateSpace, float]]:
    """(K, delay) of PD, PID, lead with integrator and loop shaping, three in ten with a sample of
    delay.
    """
    rng = np.random.default_rng(seed)
    plant = robust.sampled(control.ss(control.tf([1], [1, 0.4, 80e3])), T)
    found = []
    while len(found) < n:
        kind = rng.choice(["PD", "PID", "lead", "ncfsyn"])
        delay = T if rng.random() < 0.3 else 0.0
        gain = rng.choice([-1, 1], p=[0.25, 0.75]) * 10 ** rng.uniform(3, 4.9)
        damper, integral = 10 ** rng.uniform(0.5, 2.4), 10 ** rng.uniform(4.5, 6.7)
        if kind == "ncfsyn":
            W = robust.shaping.crossover_weight(plant, 2 * np.pi * 10 ** rng.uniform(0.7, 2))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                design = robust.ncfsyn(plant, W)
            if not design.met:
                continue
            g = 10 ** rng.uniform(-1, 0.5)
            K = control.StateSpace(design.K.A, design.K.B, g * design.K.C, g * design.K.D, T)
        elif kind == "lead":
            corner = 2 * np.pi * 10 ** rng.uniform(1.3, 2.2)
            lead = robust.lti.discretize(
                robust.shaping.lead(omega=corner, phase=np.deg2rad(rng.uniform(20, 60))), T
            )
            K = control.ss(lead) * pid_sampled(abs(gain), integral, 0.0)
        else:
            K = pid_sampled(
                gain if kind == "PID" else abs(gain), integral if kind == "PID" else 0.0, damper
            )
            if kind == "PD":
                K = control.StateSpace(
                    [[0.0]], [[1.0]], [[-damper / T]], [[abs(gain) + damper / T]], T
                )
        found.append((control.StateSpace(K.A, K.B, K.C, K.D, T), delay))
    return found
