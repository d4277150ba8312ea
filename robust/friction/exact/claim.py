"""``FrictionClaim``: a claim on a machine with friction, with every number as given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np

from nlfrf._base.values import value
from robust.friction.exact.classes import PortClaim
from robust.friction.exact.settling import Settling
from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.claim_files import WHOLE


@value
class Actuator:
    """An actuator u = sat(command), and the numbers that prove rest in spite of it."""

    # limit, Fs: largest force of the actuator and of the friction [N]
    limit: float
    Fs: float
    # initial velocity at the friction port [m/s], at rest and relaxed, up to which the claim holds.
    # It has no meaning for a share of one: the claim then holds from every state.
    kick: float
    # sector gain: w (share c'y - w) >= 0 for the deficit w = command - u and the command c'y, if
    # c'y is small enough
    share: float
    sector: float  # weight of this inequality
    # forgets, weights: (J,) filters of the delivered force, as a share of each sample or a rate
    # [1/s], and their weights
    forgets: np.ndarray
    weights: np.ndarray


@value
class FrictionClaim:
    """The claim that u = -K y around p' = A p + B (u, -f) comes to rest or settles with a class of
    friction, with all numbers of the claim.

    Fields
    ------
    machine : Matrices
        Inputs: force of the actuator, force at each friction port [N]; outputs: measured position,
        displacement at each port [m].
    controller : Matrices
        Sampled, or continuous (dt = 0).
    delay : float
        Delay from the sample to the change of the force [s]. Within 1e-9 of a whole number of
        samples it is that number.
    ports : tuple of MaxwellSlipPort or BristlePort
        The class of the friction at each port, with the weights of its filters. The filters of V
        and P follow port by port.
    V : (n, n) ndarray
        Coordinates of the stored energy.
    P : (I, 4, n, n) ndarray
        Bernstein coefficients of the stored energy in V, interval by interval; (1, 1, n, n) for a
        continuous K.
    counts : (S,) integer ndarray
        Number of intervals of equal length in each span between changes of the force.
    actuator : Actuator or None
        None if the actuator never saturates. Its filters are the last states of the loop, before
        those of the friction.
    settling : Settling or None
        None if rest is claimed; else the bound that is claimed.
    """

    SCHEMA: ClassVar[str] = "robust-friction-certificate"
    UNITS: ClassVar[Mapping[str, str]] = {
        "dt": "s",
        "delay": "s",
        "bristle_time": "s",
        "rates": "rad/s",
    }
    LOOP: ClassVar[str] = (
        "u = -K y, sat(-K y) with an actuator, sampled, delayed, held; p' = A p + B (u, -f), C p:"
        " measured, displacement at the port"
    )

    machine: Matrices
    controller: Matrices
    delay: float
    ports: tuple[PortClaim, ...]
    V: np.ndarray
    P: np.ndarray
    counts: Annotated[np.ndarray, WHOLE]
    actuator: Actuator | None = None
    settling: Settling | None = None

    def __post_init__(self) -> None:
        size = 1 + len(self.ports)
        if (self.machine.D.shape, self.controller.D.shape) != ((size, size), (1, 1)):
            raise ValueError(
                "machine must have one input and one output more than friction ports, and"
                " controller one of each, got other shapes"
            )
        if size > 2 and not (
            self.actuator is None and all(port.joins_ports for port in self.ports)
        ):
            raise ValueError(
                "ports must each be Maxwell slip, and actuator None, with several ports, got others"
            )
        n = self.V.shape[0]
        if (self.V.shape, self.P.shape) != ((n, n), (*self.P.shape[:2], n, n)):
            raise ValueError(
                f"P must hold matrices of the size of V, got shapes {self.P.shape} and"
                f" {self.V.shape}"
            )
        for port in self.ports:
            if port.rates.shape != port.weights.shape or port.rates.ndim != 1:
                raise ValueError(
                    f"weights must have one entry for each rate, got {port.weights.shape} for"
                    f" {port.rates.shape}"
                )
        for part in filter(None, (self, self.actuator, self.settling, *self.ports)):
            for name, number in vars(part).items():
                if isinstance(number, float | np.ndarray) and not np.isfinite(number).all():
                    raise ValueError(f"{name} must be finite, got nan or inf")
        if self.actuator is not None and self.actuator.forgets.shape != self.actuator.weights.shape:
            raise ValueError("actuator must have a weight for each filter, got another number")
        if self.settling is not None:
            if self.actuator is not None:
                raise ValueError("settling must have no actuator, got one")
            if (self.settling.Fs.size, self.settling.rest_weights.size) != (len(self.ports),) * 2:
                raise ValueError(
                    "settling must have a force and a weight for each port, got another number"
                )
