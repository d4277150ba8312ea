"""A motor and a load with play between them, under a P-PI drive: the machine that the simulated
axis is not.
"""

import math

import numpy as np


def play_backlash(
    experiment,
    *,
    m1,
    m2,
    k,
    c,
    play,
    motor_K0,
    motor_Fs,
    load_K0,
    load_Fs,
    kv,
    kp,
    tn,
    lag,
    steps=6,
):
    """Force set point and motor position [N], [m] of an experiment; friction is one elasto-plastic
    element a mass.
    """
    fs = experiment.ms.fs
    points = experiment.set_points(0)
    n = experiment.n_rows
    position, velocity, force = (
        points.get(name, np.zeros(n)).tolist() for name in ("position", "velocity", "force")
    )
    h, keep = 1 / fs / steps, math.exp(-1 / fs / steps / lag)
    x1 = v1 = x2 = v2 = z1 = z2 = F = total = last = last_set = pending = 0.0
    u, y = np.zeros(n), np.zeros(n)
    for i in range(n):
        speed, ahead = (x1 - last) * fs, (position[i] - last_set) * fs
        last, last_set = x1, position[i]
        error = kv * (position[i] - x1) + ahead + velocity[i] - speed
        wanted = kp * error + total + force[i]
        total += kp / (fs * tn) * error
        u[i], y[i] = wanted, x1
        for _ in range(steps):
            F = pending + (F - pending) * keep
            gap = x1 - x2
            touch = (
                0.0
                if abs(gap) < play / 2
                else k * (gap - math.copysign(play / 2, gap)) + c * (v1 - v2)
            )
            v1 += h * (F - touch - motor_K0 * z1) / m1
            v2 += h * (touch - load_K0 * z2) / m2
            x1 += h * v1
            x2 += h * v2
            z1 = (
                max(-motor_Fs / motor_K0, min(motor_Fs / motor_K0, z1 + h * v1))
                if motor_Fs
                else 0.0
            )
            z2 = max(-load_Fs / load_K0, min(load_Fs / load_K0, z2 + h * v2)) if load_Fs else 0.0
        pending = wanted
    return u, y
