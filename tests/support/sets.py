"""Systems as robust holds them: the nominal of a set, the system of a file, the poles in a report."""

from pathlib import Path
from tempfile import TemporaryDirectory

import control
import numpy as np
from scipy.io import savemat

import robust
from robust.io.from_matlab import load_matlab_system
from tests.support.printed import unwrapped


def set_around(G, w=1.0, form="multiplicative"):
    """A set of one channel, known at one frequency."""
    omega = np.array([1.0])
    dt = G.dt if isinstance(G, control.StateSpace | control.TransferFunction) else 0
    radius = np.abs(w(np.exp(1j * dt) if dt else 1j)) if callable(w) else w
    return robust.UncertaintyModel(G, w, form, omega, np.array([radius]), perturbation="LTI")


def from_roots(zeros, poles, gain):
    """The system of a zpk that MATLAB saved."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "zpk.mat"
        savemat(path, {"z": zeros[:, None], "p": poles[:, None], "k": gain, "Ts": 0.0})
        return load_matlab_system(path)


def realised(G):
    """The state space of a matrix of transfer functions: the nominal of a set around it."""
    return robust.UncertaintyModel(
        G, form="additive", left=(1,) * G.noutputs, right=(1,) * G.ninputs, omega=np.array([1.0])
    ).nominal


def unstable_poles(report):
    """The number of unstable poles of a nominal loop with its delay, as its report has it."""
    if report.nominally_stable:
        return 0
    return float(unwrapped(report).partition("with its delay has ")[2].partition(" unstable")[0])
