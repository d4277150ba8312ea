"""Friction of a class and a linear part that is not known exactly, together: a test at frequencies, no proof.

The linear part is off by any stable LTI system at the friction port: a force p = Delta q beside that of the friction,
with |Delta| <= 1 and q = (stiffness + mass w^2) x. Around the loop v = M (f - p), x = v/jw; a class of friction allows
weights mu_j of its rows, the uncertainty a weight D(w) >= 0 at every frequency, and

    sum mu_j row_j(f, v) + D(w) (|q|^2 - |p|^2) < 0   for all (f, p) at every w

contradicts any motion that goes on, as far as frequencies of a grid and the sampler's first alias can tell.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import require_nonnegative, short_form
from nlfrf._base.values import value
from robust._base.types import Controller
from robust.friction.classes import AnyFriction
from robust.friction.plant import FrictionPlant, friction_loop, loop_frequencies, mobility, require_one_port
from robust.friction.proof.multipliers import filter_rates, filter_terms, negative_multipliers
from robust.lti.realisation import state_space

N_POINTS = 200
MIN_SHARE = 1e-9  # of a row that has to be left
MARGIN_STEP = 1.5  # of the margin
MAX_MARGIN = 16.0


@value
class FrequencyTest:
    """Whether weights were found for a class of friction and an uncertain linear part: a frequency test, no proof.

    Fields
    ------
    holds : bool
        At every frequency of a grid.
    mass, stiffness : float
        How far the linear part may be off [kg], [N/m].
    margin : float
        How many times that was found to hold too, at most 16; nan where it does not hold at all.
    description : str
        What was tested, and what it is not.

    References
    ----------
    A. Megretski, A. Rantzer, IEEE Trans. Automatic Control 42, 1997 (multipliers for several blocks at once).

    Examples
    --------
    >>> import control
    >>> from robust.friction import any_maxwell_slip, friction_frequency_test
    >>> from robust import friction_plant
    >>> PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)
    >>> rig, slip = friction_plant(1.0, 80e3, 0.4), any_maxwell_slip(64e3)
    >>> friction_frequency_test(rig, PD, slip, mass=0.02, stiffness=800.0).holds
    True
    """

    holds: bool
    mass: float
    stiffness: float
    margin: float
    description: str

    def __str__(self) -> str:
        return self.description


def friction_frequency_test(
    machine: FrictionPlant,
    K: Controller,
    friction: AnyFriction,
    *,
    mass: float,
    stiffness: float,
    delay: float = 0.0,
    margin: bool = False,
) -> FrequencyTest:
    """Test Maxwell-slip friction of a class together with an LTI error of the linear part, at frequencies: no proof.

    Parameters
    ----------
    machine : FrictionPlant
        The linear part, from `friction_plant`.
    K : control.StateSpace, TransferFunction or float
        Controller, u = K (r - y); sampled, or continuous and proper.
    friction : AnyFriction
        From `any_maxwell_slip`.
    mass, stiffness : float
        How far the linear part may be off [kg], [N/m]: any stable LTI force at the friction port of at most
        (stiffness + mass omega^2) |x|, among them another mass and another spring.
    delay : float
        From sampling to the force changing [s].
    margin : bool
        Whether to look for how many times that still holds.

    Returns
    -------
    FrequencyTest

    Raises
    ------
    ValueError
        Another class of friction; a negative error, or none at all.

    References
    ----------
    A. Megretski, A. Rantzer, IEEE Trans. Automatic Control 42, 1997.

    Examples
    --------
    >>> from robust.friction import any_maxwell_slip
    >>> from robust import friction_plant
    >>> rig = friction_plant(1.0, 80e3, 0.4)
    >>> friction_frequency_test(rig, 1e3, any_maxwell_slip(64e3), mass=0.0, stiffness=90e3).holds   # no spring left
    False
    """
    if not isinstance(machine, FrictionPlant):
        raise ValueError(f"machine must be a friction_plant, got {short_form(machine)}")
    require_one_port(machine)
    if not (isinstance(friction, AnyFriction) and friction.kind == "Maxwell slip"):
        raise ValueError(f"friction must be any_maxwell_slip(...), got {short_form(friction)}")
    mass, stiffness = require_nonnegative("mass", mass), require_nonnegative("stiffness", stiffness)
    if not mass + stiffness > 0:
        raise ValueError(
            "mass and stiffness must not both be zero: `prove_friction` knows the linear part, got 0 and 0"
        )
    loop = friction_loop(machine, state_space("K", K), delay)
    omega = loop_frequencies(loop, N_POINTS)
    M, error = mobility(loop, omega), stiffness + mass * omega**2
    fastest = 1 / friction.bristle_time if friction.bristle_time else np.inf
    rates = filter_rates(1.5 * machine.resonance or 100.0, fastest)[0]

    def holds(times: float) -> bool:
        table, q = uncertain_rows(M, omega, rates=rates, K0=friction.K0, rho=friction.stiction, error=times * error)
        return loop.growth() < 0 and find_multipliers(table, q)

    found, times = holds(1.0), np.nan
    if found:
        times = 1.0
        while margin and times < MAX_MARGIN and holds(times * MARGIN_STEP):
            times *= MARGIN_STEP
    return FrequencyTest(
        holds=found,
        mass=mass,
        stiffness=stiffness,
        margin=times,
        description=describe_test(found, mass, stiffness=stiffness, times=times, friction=friction),
    )


def uncertain_rows(
    mobility: np.ndarray, omega: np.ndarray, *, rates: np.ndarray, K0: float, rho: float, error: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (W, 1 + J, 2, 2) hermitian rows of the friction in (f, p), and (W, 2, 2) that of |q|^2 - |p|^2.

    error : (W,) largest |p/x| [N/m].
    """
    factors, lost = filter_terms(omega, rates, K0=K0, rho=rho)
    multiplier_row = factors * mobility[:, None]
    table = np.zeros((omega.size, 1 + rates.size, 2, 2), complex)
    table[..., 0, 0] = multiplier_row.real - lost
    table[..., 0, 1], table[..., 1, 0] = -multiplier_row / 2, -multiplier_row.conj() / 2  # v = M (f - p)
    squared_error = (error * np.abs(mobility) / omega) ** 2
    q = squared_error[:, None, None] * np.array([[1, -1], [-1, 1]]) - np.diag([0, 1])
    return table, q


def find_multipliers(table: np.ndarray, q: np.ndarray) -> bool:
    """Return whether weights mu >= 0 and D(w) >= 0 make every matrix negative."""
    own = np.zeros((q.shape[0], *q.shape), complex)  # D of each frequency counts there alone
    own[np.arange(q.shape[0]), np.arange(q.shape[0])] = q
    return negative_multipliers(np.concatenate([table, own], axis=1), couplings=(1.0,), least=MIN_SHARE) is not None


def describe_test(holds: bool, mass: float, *, stiffness: float, times: float, friction: AnyFriction) -> str:
    """Describe what was tested, and that it is no proof."""
    units = friction.units
    size = f"{mass:.2g} {units.mass} and {stiffness / 1e3:.3g} {units.stiffness}"
    off = f"a linear part off by up to {size} at the friction port"
    more = f", up to {times:.2g} times that" if holds and times > 1 else ""
    verdict = "holds" if holds else "was not found to hold"
    return (
        f"Frequency test, not a proof (the sampler's first alias, frequencies of a grid): with {friction.description}, "
        f"and {off}{more}, dissipation {verdict}."
    )
