"""What a proof with friction is worth where the actuator saturates: from every state, or up to a kick."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nlfrf._base.arguments import require_positive
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict, Outcome
from robust._base.types import Controller
from robust.friction.classes import AnyFriction, FrictionAtPorts
from robust.friction.exact.claim import Actuator, FrictionClaim
from robust.friction.exact.verify import verify_friction
from robust.friction.plant import (
    FrictionLoop,
    FrictionPlant,
    driven_states,
    friction_loop,
    loop_frequencies,
    require_one_port,
)
from robust.friction.proof.certify import (
    NOT_IN_CLASS,
    Finding,
    Multipliers,
    build_claim,
    certify_friction,
    describe_scope,
    reference_rate,
)
from robust.friction.proof.dissipation import maxwell_slip_dissipation
from robust.friction.proof.multipliers import filter_rates, hermitian_product, negative_multipliers
from robust.friction.proof.storage import METHOD, Block, Dissipation, JudgedStorage, certified_dissipation
from robust.lti.realisation import state_space
from robust.proofs.search.certificate import Certificate

if TYPE_CHECKING:
    import control

# ---- How hard a kick a stored energy allows an actuator: it falls, and what is asked for is bounded by it.
#
# At rest and relaxed, a kick e v0 puts in v0^2 e'P e at most, at whatever instant. The force that is asked for is
# asked'y + h, with h what holds the friction, and |asked'y| <= sqrt(c asked'E^-1 asked) where the energy E <= c.

ROUNDED_DOWN = 0.99  # far more than the rounding in E^-1


def velocity_within_reach(energy: JudgedStorage, command_row: np.ndarray, *, hit: np.ndarray, reach: float) -> float:
    """Return the initial velocity [m/s] up to which |c'y| stays below a reach [N]; hit .

    (n,) the state change of 1 m/s.

    Infinite where nothing is asked for, whatever the state.
    """
    if not command_row.any():
        return np.inf
    size = energy.V.shape[0]
    read = np.zeros(energy.stored.shape[0])
    read[:size] = energy.V.T @ command_row
    whole = energy.stored.copy()
    whole[:size, :size] += energy.P[-1, -1]  # just before a sample, where the force is asked for
    unit = 1 / np.sqrt(np.diag(whole))
    peak_command = (unit * read) @ np.linalg.solve(whole * np.outer(unit, unit), unit * read)
    start = np.linalg.solve(energy.V, hit)
    put_in = float(np.einsum("i,...ij,j", start, energy.P, start).max())
    return float(ROUNDED_DOWN * reach / np.sqrt(peak_command * put_in))


# ---- The loop cut open at an actuator that saturates: what it is asked for, and where what it does not give is
# missing.
#
# The actuator gives u = sat(asked) and misses w = asked - u, so that y+ = J y - enters w at a sample (y' = F y -
# enters w
# where the controller is continuous). Beside the state of the sliding loop stand filters of the force it gives, which
# the
# proof reads and the machine never sees: u_j+ = u_j + phi_j (u - u_j), or u_j' = phi_j (u - u_j).


@value
class LureLoop:
    """A sliding loop with its actuator cut open, and filters beside it.

    Fields
    ------
    loop : FrictionLoop
        With the filters as its last states.
    command_row : (n,) ndarray
        The force that is asked for, of the state before a sample.
    input_column : (n,) ndarray
        Where what is missed is taken off: at a sample, or of the flow.
    forgets : (J,) ndarray
        How fast the filters forget: a share of each sample, or a rate [1/s].
    """

    loop: FrictionLoop
    command_row: np.ndarray
    input_column: np.ndarray
    forgets: np.ndarray

    @property
    def filters(self) -> slice:
        """Where the filters stand in the state."""
        return slice(self.command_row.size - self.forgets.size, self.command_row.size)

    def open_growth(self) -> float:
        """How the loop grows with its actuator cut off, nothing of what is asked for given; negative where it dies."""
        return with_zero_input(self).growth()


def open_at_actuator(
    machine: FrictionPlant, K: Controller, delay: float, forgets: np.ndarray | None = None
) -> LureLoop:
    """Open the loop u = -K y at its actuator, with filters that forget at the given rates.

    >>> from robust.friction.plant import friction_plant
    >>> cut = open_at_actuator(friction_plant(1.0, 80e3, 0.4), 2e3, 0.0)
    >>> (0 + cut.command_row).tolist(), cut.input_column.tolist()  # of displacement and velocity
    ([-2000.0, 0.0], [0.0, 1.0])
    """
    K = state_space("K", K)
    loop = friction_loop(machine, K, delay)
    forgets = np.zeros(0) if forgets is None else forgets
    n, m, s = machine.A.shape[0], loop.F.shape[0], K.nstates
    size = m + forgets.size
    command_row, input_column = np.zeros(size), np.zeros(size)
    command_row[:n] = -K.D[0, 0] * machine.C_measured
    command_row[m - s : m] = K.C[0] if s else 0.0
    if loop.T:
        input_column[n + 1 if m > n + 1 + s else n] = 1.0  # the force that waits, or the one that is held
    else:
        input_column[:n] = machine.B_force
    input_column[m:] = forgets
    F, jumps = (
        embed_matrix(loop.F, size),
        np.array([embed_matrix(J, size, 1.0) for J in loop.jumps]).reshape(-1, size, size),
    )
    rows = np.outer(forgets, command_row)  # of u = asked - w
    rows[:, m:] -= np.diag(forgets)
    if loop.T:
        jumps[0][m:] += rows
    else:
        F[m:] = rows
    parts = {name: np.pad(getattr(loop, name), (0, size - m)) for name in ("B", "x", "v", "measured")}
    wider = FrictionLoop(F=F, T=loop.T, spans=loop.spans, jumps=jumps, **parts)
    return LureLoop(loop=wider, command_row=command_row, input_column=input_column, forgets=forgets)


def with_zero_input(cut: LureLoop) -> FrictionLoop:
    """Return the loop with u = 0."""
    loop, missing = cut.loop, np.outer(cut.input_column, cut.command_row)
    if not loop.T:
        return replace(loop, F=loop.F - missing)
    return replace(loop, jumps=np.concatenate([loop.jumps[:1] - missing, loop.jumps[1:]]))


def embed_matrix(M: np.ndarray, size: int, diagonal: float = 0.0) -> np.ndarray:
    """Return a square matrix as the leading part of a larger one, with the rest on the diagonal."""
    n = M.shape[0]
    larger = np.diag(np.concatenate([np.zeros(n), np.full(size - n, diagonal)]))
    larger[:n, :n] = M
    return larger


# ---- The dissipation inequality of a friction of a class and an actuator that saturates, in states that come to rest.
#
# To the inequality of the friction comes, with y the state less where it rests, u - h = asked'y - w and weights theta,
#
#     theta_0 w (share asked'y - w) + sum theta_j w (asked'y - w - u_j)
#
# at every sample, or in the flow with w as one input more: what an actuator never makes negative.


def with_saturation(form: Dissipation, cut: LureLoop, *, share: float, sector: float, given: np.ndarray) -> Dissipation:
    """Add the dead zone to the dissipation inequality; form.

    That of the friction, whose first states are those of the open loop.
    """
    n = form.A.shape[0]
    command_row, input_column = (np.pad(row, (0, n - row.size)) for row in (cut.command_row, cut.input_column))
    output_row = (share * sector + given.sum()) / 2 * command_row
    output_row[cut.filters] -= given / 2
    weight = float(sector + given.sum())
    if cut.loop.T:
        return replace(form, block=Block(input_column=input_column, output_row=output_row, weight=weight))
    m = form.B.shape[1]
    R = np.zeros((m + 1, m + 1))
    R[:m, :m], R[m, m] = form.R, -weight
    return replace(
        form,
        B=np.column_stack([form.B, -input_column]),
        B_error=np.column_stack([form.B_error, np.zeros(n)]),
        N=np.column_stack([form.N, output_row]),
        R=R,
    )


# ---- Weights for a friction of a class and an actuator that saturates, together, by linear programs over frequency.
#
# What the actuator misses, w = asked - u, obeys at every instant, for filters u_j of the force it gives,
#
#     w (share (asked - h) - w) >= 0    while (1 - share) |asked - h| is at most what the limit leaves over friction
#     w (u - u_j)               >= 0    as a mean of the past never exceeds the limit
#
# with h the force that holds the friction at rest. With those of the friction they make one hermitian matrix in (f, w)
# a
# frequency. Nothing here is a proof.

MIN_SHARE = 1e-9  # share of a row that has to be left
COUPLINGS = (0.7, 0.9, 0.97, 0.99)  # of f and w, of what a definite matrix allows: slack for what the sampler folds


@value
class SaturationMultipliers:
    """Weights of friction and actuator.

    Fields
    ------
    mu : (1 + R,) ndarray
        Of the friction itself, and of its filters.
    sector : float
        Of w (share (asked - h) - w).
    given : (J,) ndarray
        Of the filters of the actuator.
    """

    mu: np.ndarray
    sector: float
    given: np.ndarray


def saturation_terms(
    cut: LureLoop, omega: np.ndarray, *, rates: np.ndarray, K0: float, rho: float, forgets: np.ndarray, share: float
) -> np.ndarray:
    """Return (W, 1 + R + 1 + J, 2, 2) hermitian forms in (f, w).

    Friction, its filters, sector, filters of the actuator.
    """
    loop, s = cut.loop, 1j * omega
    none = np.zeros(loop.B.size)
    by_f, before_f = driven_states(loop, omega, flow=loop.B, struck=none)
    by_w, before_w = (
        driven_states(loop, omega, flow=none, struck=-cut.input_column)
        if loop.T
        else driven_states(loop, omega, flow=-cut.input_column, struck=none)
    )
    v, command_row = np.stack([by_f, by_w], axis=1) @ loop.v, np.stack([before_f, before_w], axis=1) @ cut.command_row
    f, w = np.broadcast_to([1.0, 0.0], v.shape), np.broadcast_to([0.0, 1.0], v.shape)
    rest = float(cut.command_row @ loop.rest()[0]) * (rates[0] / (rates[0] + s))[:, None] * f
    columns = [hermitian_product(f, v)]
    for a in rates:
        stiction_row = (1 - a / (rho * (a - s)))[:, None] * v
        columns.append(
            hermitian_product(f, stiction_row)
            - (a * omega**2 / (rho * K0 * (a**2 + omega**2)))[:, None, None] * hermitian_product(f, f)
        )
    each = 1 / loop.T if loop.T else 1.0  # samples a second
    columns.append(each * hermitian_product(w, share * (command_row - rest) - w))
    step = np.exp(s * loop.T) - 1 if loop.T else s
    columns += [each * hermitian_product(w, (step / (step + phi))[:, None] * (command_row - w)) for phi in forgets]
    return np.stack(columns, axis=1)


def saturation_multipliers(table: np.ndarray, n_rates: int) -> SaturationMultipliers | None:
    """Return few multipliers that make every matrix negative; None where none were found."""
    for coupling in COUPLINGS:
        found = negative_multipliers(table, coupling=coupling, least=MIN_SHARE)
        if found is not None:
            mu, sector, given = found[: n_rates + 1], float(found[n_rates + 1]), found[n_rates + 2 :]
            return SaturationMultipliers(mu=mu, sector=sector, given=given)
    return None


# ---- How far a machine is proved with an actuator that saturates: shares it may miss, tried one after another.

N_POINTS = 200
N_SETS = 2  # of filters of the friction
FILTER_SHARES = np.geomspace(1e-3, 1.0, 10)  # of a sample
FILTER_RATES = np.geomspace(1e-2, 30.0, 10)  # over the reference, where nothing is sampled
#: What of asked - h an actuator may miss, at most: the larger, the further it reaches, and the harder to prove.
SECTOR_GAINS = (0.02, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98)
MAX_FAILURES = 2  # in a row, after which larger shares are left


@value(copy=False)
class RegionOfAttraction:
    """A kick that is proved, and the numbers it is proved with.

    Fields
    ------
    kick, share : float
    sector : float
    forgets, weights : (J,) ndarray
        Filters of the actuator.
    numbers : Multipliers
        Weights of the friction.
    energy : JudgedStorage
    """

    kick: float
    share: float
    sector: float
    forgets: np.ndarray
    weights: np.ndarray
    numbers: Multipliers
    energy: JudgedStorage


def largest_region(
    machine: FrictionPlant, K: control.StateSpace, *, friction: AnyFriction, delay: float, left: float
) -> RegionOfAttraction | None:
    """Return the largest region of attraction that was found. left : limit less friction [N]."""
    cut = open_at_actuator(machine, K, delay)
    if cut.open_growth() < 0:
        everywhere = region_for_sector(machine, K, friction=friction, delay=delay, cut=cut, share=1.0, reach=np.inf)
        if everywhere is not None:
            return everywhere
    best, missed = None, 0
    for share in SECTOR_GAINS:
        found = region_for_sector(
            machine, K, friction=friction, delay=delay, cut=cut, share=share, reach=left / (1 - share)
        )
        missed = missed + 1 if found is None else 0
        if found is not None and (best is None or found.kick > best.kick):
            best = found
        if missed == MAX_FAILURES and share > SECTOR_GAINS[MAX_FAILURES]:
            break
    return best


def region_for_sector(
    machine: FrictionPlant,
    K: control.StateSpace,
    *,
    friction: AnyFriction,
    delay: float,
    cut: LureLoop,
    share: float,
    reach: float,
) -> RegionOfAttraction | None:
    """Return the region that is proved with one sector gain, or None."""
    omega, reference = loop_frequencies(cut.loop, N_POINTS), reference_rate(machine, cut.loop)
    fastest = 1 / friction.bristle_time if friction.bristle_time else np.inf
    forgets = FILTER_SHARES if cut.loop.T else FILTER_RATES * reference
    for rates in filter_rates(reference, fastest)[:N_SETS]:
        table = saturation_terms(
            cut, omega, rates=rates, K0=friction.K0, rho=friction.stiction, forgets=forgets, share=share
        )
        weights = saturation_multipliers(table, rates.size)
        if weights is None or not weights.mu[1:].any():
            continue
        own = weights.given > 0
        wider = open_at_actuator(machine, K, delay, forgets[own])
        form = maxwell_slip_dissipation(wider.loop, rates, mu=weights.mu, K0=friction.K0, rho=friction.stiction)
        form = with_saturation(form, wider, share=share, sector=weights.sector, given=weights.given[own])
        failed, energy = certified_dissipation(form)
        if energy is not None and not failed:
            kick = largest_velocity(machine, wider, energy=energy, reach=reach) if np.isfinite(reach) else np.inf
            return RegionOfAttraction(
                kick=kick,
                share=share,
                sector=weights.sector,
                forgets=forgets[own],
                weights=weights.given[own],
                numbers=used_multipliers(rates, weights),
                energy=energy,
            )
    return None


def used_multipliers(rates: np.ndarray, weights: SaturationMultipliers) -> Multipliers:
    """Return what a claim keeps of the multipliers."""
    used = np.append(True, weights.mu[2:] > 0)
    return Multipliers(rates=rates[used], weights=weights.mu[1:][used], free=float(weights.mu[0]))


def largest_velocity(machine: FrictionPlant, cut: LureLoop, *, energy: JudgedStorage, reach: float) -> float:
    """Return the initial velocity [m/s] up to which a storage keeps the commanded force within reach [N]."""
    size = energy.V.shape[0]
    hit = np.zeros(size)
    hit[: machine.A.shape[0]] = machine.B_port / (machine.velocity @ machine.B_port)
    return velocity_within_reach(
        energy, np.pad(cut.command_row, (0, size - cut.command_row.size)), hit=hit, reach=reach
    )


SUBJECT = "the stored energy falls, the actuator saturated or not"
NOT_CLAIMED = (
    "Not claimed: {other}friction above {Fs:g} {unit}, an actuator of less than {limit:g} {unit}, quantisation, "
    "another linear part."
)
NO_ACTUATOR_CLAIM = "Not claimed: anything with an actuator that saturates."


class ForceLimits(NamedTuple):
    """The class of friction, its largest force and that of the actuator."""

    friction: AnyFriction
    Fs: float
    limit: float


def limits_of_force(
    machine: FrictionPlant, friction: AnyFriction | FrictionAtPorts, forces: np.ndarray, saturation: float
) -> ForceLimits:
    """Return what friction and actuator have, or refuse what no proof is made for."""
    require_one_port(machine)
    if not isinstance(friction, AnyFriction) or friction.kind not in ("Maxwell slip", "bristle"):
        raise ValueError(f"friction must be any_maxwell_slip(...) or any_bristle(...), got {friction.description}")
    limit, Fs, unit = require_positive("saturation", saturation), float(forces[0]), friction.units.force
    if not limit > Fs:  # nan: not given
        raise ValueError(
            f"saturation must be above Fs, the largest friction force, got {limit:g} {unit} and Fs = {Fs:g} {unit}"
        )
    return ForceLimits(friction=friction, Fs=Fs, limit=limit)


def with_actuator(
    machine: FrictionPlant, K: control.StateSpace, *, delay: float, plain: Finding, known: ForceLimits
) -> dict[str, Any]:
    """Return what is found with the actuator, from what is without, by the fields of a proof."""
    friction = known.friction

    def nothing(verdict: FrictionVerdict, reason: str) -> dict[str, Any]:
        parts = {"verdict": verdict, "reason": reason, "claim": "", "certificate": None, "saturation": known.limit}
        return parts | {"not_claimed": NO_ACTUATOR_CLAIM, "kick": 0.0, "kick_linear": 0.0, "share": 0.0}

    if plain.verdict is not FrictionVerdict.PROVED:
        return nothing(plain.verdict, f"without saturation: {plain.reason}")
    cut = open_at_actuator(machine, K, delay)
    rest, offset = cut.loop.rest()
    left = known.limit - known.Fs * float(abs(cut.command_row @ rest) + np.abs(cut.command_row) @ offset)
    if left <= 0:
        return nothing(FrictionVerdict.NOT_DECIDED, "holding the friction takes all of the limit")
    if not machine.velocity @ machine.B_port > 0:
        return nothing(FrictionVerdict.NOT_DECIDED, "a kick at the friction port moves no velocity at once")
    try:
        linear = certify_friction(cut.loop, friction, reference_rate(machine, cut.loop)).energy
        kick_linear = 0.0 if linear is None else largest_velocity(machine, cut, energy=linear, reach=left)
        reach = (
            largest_region(machine, K, friction=friction, delay=delay, left=left)
            if friction.kind == "Maxwell slip"
            else None
        )
    except (np.linalg.LinAlgError, ValueError, FloatingPointError) as error:
        return nothing(FrictionVerdict.NOT_DECIDED, f"numerical failure: {error}")
    everywhere = np.isinf(kick_linear) or (reach is not None and reach.share == 1)
    certificate, kick, share = plain.certificate, kick_linear, 0.0
    if reach is not None and reach.kick > kick_linear:
        exact = build_claim(machine, K, delay=delay, friction=friction, numbers=(reach.numbers,), stored=reach.energy)
        certificate, kick, share = saturation_certificate(exact, reach, known), reach.kick, reach.share
    scope = describe_scope(machine, friction, K=K, delay=delay)
    other, unit = NOT_IN_CLASS[friction.kind], friction.units.force
    return {
        "verdict": FrictionVerdict.PROVED if everywhere else FrictionVerdict.PROVED_LOCALLY,
        "claim": describe_claim(np.inf if everywhere else kick, scope, known),
        "reason": "" if everywhere else describe_why_local(cut, friction),
        "not_claimed": NOT_CLAIMED.format(other=other, Fs=known.Fs, limit=known.limit, unit=unit),
        "certificate": certificate,
        "saturation": known.limit,
        "kick": kick,
        "kick_linear": kick_linear,
        "share": share,
    }


def saturation_certificate(claim: FrictionClaim, reach: RegionOfAttraction, known: ForceLimits) -> Certificate:
    """Return the certificate of what was decided, with the actuator in it."""
    kick = reach.kick if np.isfinite(reach.kick) else 0.0
    actuator = Actuator(
        limit=known.limit,
        Fs=known.Fs,
        kick=kick,
        share=reach.share,
        sector=reach.sector,
        forgets=reach.forgets,
        weights=reach.weights,
    )
    return Certificate(
        subject=SUBJECT,
        outcome=Outcome.HOLDS,
        level=0.0,
        method=METHOD,
        intervals=np.array([[0.0, np.inf]]),
        reason="",
        claim=replace(claim, actuator=actuator),
        again=verify_friction,
    )


def describe_claim(kick: float, scope: str, known: ForceLimits) -> str:
    """State what is proved in one sentence: from every state where the velocity is infinite.

    Else up to that velocity.
    """
    rest, units = "Comes to rest from every state", known.friction.units
    if np.isfinite(kick):
        hit = f"a kick of at most {1e3 * kick:.3g} m{units.velocity} at the friction port"
        rest = f"At rest and relaxed, comes to rest again after {hit}"
    return (
        f"{rest} {scope}, with an actuator of {known.limit:g} {units.force} and friction of at most "
        f"{known.Fs:g} {units.force}."
    )


def describe_why_local(cut: LureLoop, friction: AnyFriction) -> str:
    """Say why it is not proved from every state."""
    if friction.kind != "Maxwell slip":
        return f"From every state: not tried for a {friction.kind}; the kick is one that never saturates the actuator."
    if cut.open_growth() < 0:
        return "From every state: no weights were found for all that an actuator may miss."
    return (
        "From every state: not to be had by a quadratic energy. With the actuator at its limit the loop is open and "
        "does not come to rest by itself (a controller that integrates without anti-windup, a machine without damping)."
    )
