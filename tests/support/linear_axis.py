"""The linear part of a simulated servo axis, and its drive as settings of `robust.servo`."""

from dataclasses import replace

import control
import numpy as np

import nlfrf

PRESETS = ("linear motor", "belt", "ball screw", "joint")


def frictionless(preset, *, encoder="motor", **drive):
    """The axis without friction, quantisation and limit."""
    axis = nlfrf.servo_axis(preset)
    drive = replace(axis.drive, limit=np.inf, velocity_feedforward=0.0, encoder=encoder, **drive)
    return replace(axis, motor_friction=None, load_friction=None, resolution=0.0, drive=drive)


def settings_of(axis, **more):
    """The drive of an axis as settings."""
    return replace(axis.drive, **{"limit": np.inf} | more)


def linear_plant(axis, *, sensors=("encoder",), with_lag=True):
    """Continuous, from the force set point to positions ("encoder", "motor", "load"), the lag of
    the current in it.
    """
    k, c = axis.stiffness, axis.damping
    if axis.two:
        M = np.diag([axis.motor_inertia, axis.load_inertia])
        K = np.array([[k, -k], [-k, k + axis.spring]])
        C = np.array([[axis.motor_damping + c, -c], [-c, axis.load_damping + c]])
    else:
        M = np.array([[axis.motor_inertia]])
        K = np.array([[axis.spring]])
        C = np.array([[axis.motor_damping]])
    n = len(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    B = np.vstack([np.zeros((n, 1)), np.linalg.solve(M, np.eye(n, 1))])
    rows = [{"encoder": axis.encoder}.get(sensor, sensor) == "load" for sensor in sensors]
    G = control.ss(A, B, np.hstack([np.eye(n)[np.array(rows, int)], np.zeros((len(rows), n))]), 0)
    lag = axis.drive.lag
    return (
        control.series(control.ss([[-1 / lag]], [[1 / lag]], [[1]], [[0]]), G)
        if with_lag and lag
        else G
    )
