"""``FrictionClaim``: a claim on a machine with friction, with every number as given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields
from typing import Annotated, ClassVar

import numpy as np

from nlfrf._base.values import value
from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.claim_files import WHOLE

_KINDS = ("Maxwell slip", "bristle")


@value
class Actuator:
    """An actuator that delivers u = sat(command), and the numbers that prove rest in spite of it."""

    # limit, Fs: largest force of the actuator and of the friction [N]
    limit: float
    Fs: float
    # initial velocity at the friction port [m/s], at rest and relaxed, up to which the claim holds. It has no meaning
    # for a share of one: the claim then holds from every state.
    kick: float
    # sector gain: w (share c'y - w) >= 0 for the deficit w = command - u and the command c'y, if c'y is small enough
    share: float
    sector: float  # weight of this inequality
    # forgets, weights: (J,) filters of the delivered force, as a share of each sample or a rate [1/s], and their
    # weights
    forgets: np.ndarray
    weights: np.ndarray


@value
class Settling:
    """A bound of the distance from rest under friction with stiction, and the rate of decay that proves it."""

    decay: float  # lambda [1/s] in V' + 2 lambda V <= r^2
    Fs: float  # largest friction force [N]
    error: float  # bound of the displacement at every port in the end [m]
    # (P - 1,) largest friction force at the ports after the first [N]
    other_Fs: np.ndarray = field(default_factory=lambda: np.zeros(0))
    # (P,) w_p in V' + 2 lambda V <= sum w_p r_p^2; the rests are relative to the largest of them
    rest_weights: np.ndarray = field(default_factory=lambda: np.ones(1))


@value
class PortClass:
    """The class of the friction at one port, and the weights of its filters."""

    # K0, stiction, bristle_time: limits of the class [N/m], [-], [s]
    K0: float
    stiction: float
    bristle_time: float
    free: float  # weight of the friction itself
    # rates, weights: (J,) rates of the filters [rad/s], the reference first, and their weights
    rates: np.ndarray
    weights: np.ndarray


@value
class FrictionClaim:
    """The claim that u = -K y around p' = A p + B (u, -f) comes to rest or settles with a friction class; its numbers.

    Fields
    ------
    machine : Matrices
        Inputs: force of the actuator, force at each friction port [N]; outputs: measured position, displacement at
        each port [m].
    controller : Matrices
        Sampled, or continuous (dt = 0).
    delay : float
        Delay from the sample to the change of the force [s]. Within 1e-9 of a whole number of samples it is that
        number.
    kind : str
        "Maxwell slip" or "bristle".
    K0, stiction, bristle_time, microdamping : float
        Limits of the class [N/m], [-], [s], [Ns/m].
    rates, weights : (J,) ndarray
        Rates of the filters [rad/s] and their weights; for Maxwell slip the first is the reference.
    free : float
        Weight of the friction itself.
    block : (3, 3) ndarray
        For bristles: the form in (v, q, gamma).
    bounds : (2,) ndarray
        For bristles: multiples of the sector form that are below the block.
    V : (n, n) ndarray
        Coordinates of the stored energy.
    P : (I, 4, n, n) ndarray
        Bernstein coefficients of the stored energy in V, interval by interval; (1, 1, n, n) for a continuous K.
    counts : (S,) integer ndarray
        Number of intervals of equal length in each span between changes of the force.
    actuator : Actuator or None
        None if the actuator never saturates. Its filters are the last states of the loop, before those of the friction.
    settling : Settling or None
        None if rest is claimed; else the bound that is claimed.
    other_ports : tuple of PortClass
        For Maxwell slip at several ports: the ports after the first. The filters of V and P follow port by port.
    """

    SCHEMA: ClassVar[str] = "robust-friction-certificate"
    UNITS: ClassVar[Mapping[str, str]] = {"dt": "s", "delay": "s", "bristle_time": "s", "rates": "rad/s"}
    LOOP: ClassVar[str] = (
        "u = -K y, sat(-K y) with an actuator, sampled, delayed, held; p' = A p + B (u, -f), C p: measured, "
        "displacement at the port"
    )

    machine: Matrices
    controller: Matrices
    delay: float
    kind: str
    K0: float
    stiction: float
    bristle_time: float
    microdamping: float
    rates: np.ndarray
    weights: np.ndarray
    free: float
    block: np.ndarray
    bounds: np.ndarray
    V: np.ndarray
    P: np.ndarray
    counts: Annotated[np.ndarray, WHOLE]
    actuator: Actuator | None = None
    settling: Settling | None = None
    other_ports: tuple[PortClass, ...] = ()

    @property
    def ports(self) -> tuple[PortClass, ...]:
        own = {one.name: getattr(self, one.name) for one in fields(PortClass)}
        return (PortClass(**own), *self.other_ports)

    def __post_init__(self) -> None:
        if self.kind not in _KINDS:
            raise ValueError(f"kind must be one of {', '.join(_KINDS)}, got {self.kind!r}")
        size = 2 + len(self.other_ports)
        if (self.machine.D.shape, self.controller.D.shape) != ((size, size), (1, 1)):
            raise ValueError(
                "machine must have one input and one output more than friction ports, and controller one of each, got "
                "other shapes"
            )
        if self.other_ports and (self.kind != _KINDS[0] or self.actuator is not None):
            raise ValueError("other_ports must be empty except for Maxwell slip without an actuator, got some")
        n = self.V.shape[0]
        if (self.V.shape, self.P.shape) != ((n, n), (*self.P.shape[:2], n, n)):
            raise ValueError(f"P must hold matrices of the size of V, got shapes {self.P.shape} and {self.V.shape}")
        for port in self.ports:
            if port.rates.shape != port.weights.shape or port.rates.ndim != 1:
                raise ValueError(
                    f"weights must have one entry for each rate, got {port.weights.shape} for {port.rates.shape}"
                )
        for part in filter(None, (self, self.actuator, self.settling, *self.other_ports)):
            for name, number in vars(part).items():
                if isinstance(number, float | np.ndarray) and not np.isfinite(number).all():
                    raise ValueError(f"{name} must be finite, got nan or inf")
        if self.actuator is not None and self.actuator.forgets.shape != self.actuator.weights.shape:
            raise ValueError("actuator must have a weight for each filter, got another number")
        if self.settling is not None:
            if self.actuator is not None:
                raise ValueError("settling must have no actuator, got one")
            if (self.settling.other_Fs.size + 1, self.settling.rest_weights.size) != (len(self.ports),) * 2:
                raise ValueError("settling must have a force and a weight for each port, got another number")
