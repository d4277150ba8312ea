"""Claims on any loop, made from that of one check, and verified as the file of a certificate is."""

from dataclasses import replace
from functools import cache

import control
import numpy as np

import robust

READ = {
    "multiplicative": (("G", "K"), False),
    "additive": (("K",), False),
    "inverse-multiplicative": ((), True),
    "inverse-additive": (("G",), True),
    "coprime": (("N", "M"), True),
}
SMALL = control.ss([], [], [], [[1e-9]])


@cache
def proved():
    """The certificate of a lag under a gain."""
    lag, weight = control.tf([1], [1, 1]), control.tf([0.1], [1])
    model = robust.UncertaintyModel(
        lag, weight, "multiplicative", np.array([1.0]), np.array([0.05]), perturbation="LTI"
    )
    return robust.check(model, 1.0).proofs.certificates[0]


def matrices(system):
    """A system as it stands in a claim, number by number."""
    if not isinstance(system, control.StateSpace):
        system = control.ss([], [], [], np.atleast_2d(system))
    n, D = system.nstates, np.atleast_2d(np.asarray(system.D, float))
    return replace(
        proved().claim.plant,
        A=np.asarray(system.A, float).reshape(n, n),
        B=np.asarray(system.B, float).reshape(n, D.shape[1]),
        C=np.asarray(system.C, float).reshape(D.shape[0], n),
        D=D,
        dt=float(system.dt or 0.0),
    )


def loop_claim(G, K, w=SMALL, form="additive", *, delay=0.0, w_P=None, **more):
    """The claim of robust stability, or of `claims`, on u = K (r - y) around a set."""
    return replace(
        proved().claim,
        plant=matrices(G),
        controller=matrices(K),
        weight=matrices(w),
        performance=None if w_P is None else matrices(w_P),
        **dict(zip(("reads", "inverse"), READ[form], strict=True)),
        delay=delay,
        **{"claims": ("robust stability",)} | more,
    )


def verify_loop(*loop, **more):
    """What is proved of the claim, over the rationals."""
    return proved().again(loop_claim(*loop, **more))


def decided(G, K=1.0, *, delay=0.0):
    """Whether the loop is stable, by exact arithmetic; None where that is not decided."""
    found = verify_loop(G, K, delay=delay)
    if "nominal stability" in found.proved:
        return True
    return False if "nominal stability" in found.violated else None
