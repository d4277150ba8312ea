"""A proof for a machine with friction whose actuator saturates: from every state, or up to a kick."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf._base.arguments import positive
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict, Outcome
from robust.friction.classes import AnyFriction
from robust.friction.dissipation import maxwell_slip_dissipation
from robust.friction.exact.claim import Actuator, FrictionClaim
from robust.friction.exact.verify import verify_friction
from robust.friction.multipliers import filter_rates, weights
from robust.friction.plant import SlidingLoop, SlidingMachine, driven, frequencies, separate_delay, sliding_loop
from robust.friction.prove import OTHER, certify, claimed, prove_friction, reference_rate, scope
from robust.friction.storage import METHOD, Block, Dissipation, Energy, certified_dissipation
from robust.lti.realisation import state_space
from robust.proofs.search.certificate import Certificate

__all__ = [
    "CutLoop",
    "Reach",
    "SaturatedProof",
    "SaturationWeights",
    "cut_open",
    "kick_of",
    "kick_within",
    "prove_saturated",
    "reaches",
    "saturated",
    "saturation_rows",
    "saturation_weights",
]


# ---- How hard a kick a stored energy allows an actuator: it falls, and what is asked for is bounded by it.
#
# At rest and relaxed, a kick e v0 puts in v0^2 e'P e at most, at whatever instant. The force that is asked for is
# asked'y + h, with h what holds the friction, and |asked'y| <= sqrt(c asked'E^-1 asked) where the energy E <= c.

INWARD = 0.99  # far more than the rounding in E^-1


def kick_within(energy: Energy, asked: np.ndarray, hit: np.ndarray, reach: float) -> float:
    """[m/s] up to which a kick leaves |asked'y| below a reach [N]; hit : (n,) what 1 m/s is of the states.

    Infinite where nothing is asked for, whatever the state.
    """
    if not asked.any():
        return np.inf
    size = energy.V.shape[0]
    read = np.zeros(energy.stored.shape[0])
    read[:size] = energy.V.T @ asked
    whole = energy.stored.copy()
    whole[:size, :size] += energy.P[-1, -1]  # just before a sample, where the force is asked for
    unit = 1 / np.sqrt(np.diag(whole))
    asked_for = (unit * read) @ np.linalg.solve(whole * np.outer(unit, unit), unit * read)
    start = np.linalg.solve(energy.V, hit)
    put_in = float(np.einsum("i,...ij,j", start, energy.P, start).max())
    return float(INWARD * reach / np.sqrt(asked_for * put_in))


# ---- The loop cut open at an actuator that saturates: what it is asked for, and where what it does not give is
# missing.
#
# The actuator gives u = sat(asked) and misses w = asked - u, so that y+ = J y - enters w at a sample (y' = F y -
# enters w
# where the controller is continuous). Beside the state of the sliding loop stand filters of the force it gives, which
# the
# proof reads and the machine never sees: u_j+ = u_j + phi_j (u - u_j), or u_j' = phi_j (u - u_j).


@value
class CutLoop:
    """A sliding loop with its actuator cut open, and filters beside it.

    Fields
    ------
    loop : SlidingLoop
        With the filters as its last states.
    asked : (n,) ndarray
        The force that is asked for, of the state before a sample.
    enters : (n,) ndarray
        Where what is missed is taken off: at a sample, or of the flow.
    forgets : (J,) ndarray
        How fast the filters forget: a share of each sample, or a rate [1/s].
    """

    loop: SlidingLoop
    asked: np.ndarray
    enters: np.ndarray
    forgets: np.ndarray

    @property
    def filters(self) -> slice:
        """Where the filters stand in the state."""
        return slice(self.asked.size - self.forgets.size, self.asked.size)

    def open_growth(self) -> float:
        """How the loop grows with its actuator cut off, nothing of what is asked for given; negative where it dies."""
        return without_actuator(self).growth()


def cut_open(machine: SlidingMachine, K: Any, delay: float, forgets: np.ndarray | None = None) -> CutLoop:
    """The loop u = -K y cut open at its actuator, with filters that forget as fast as said.

    >>> from robust.friction.plant import sliding_machine
    >>> cut = cut_open(sliding_machine(1.0, 80e3, 0.4), 2e3, 0.0)
    >>> (0 + cut.asked).tolist(), cut.enters.tolist()  # of displacement and velocity
    ([-2000.0, 0.0], [0.0, 1.0])
    """
    K = state_space("K", K)
    loop = sliding_loop(machine, K, delay)
    forgets = np.zeros(0) if forgets is None else forgets
    n, m, s = machine.A.shape[0], loop.F.shape[0], K.nstates
    size = m + forgets.size
    asked, enters = np.zeros(size), np.zeros(size)
    asked[:n] = -K.D[0, 0] * machine.C_measured
    asked[m - s : m] = K.C[0] if s else 0.0
    if loop.T:
        enters[n + 1 if m > n + 1 + s else n] = 1.0  # the force that waits, or the one that is held
    else:
        enters[:n] = machine.B_force
    enters[m:] = forgets
    F, jumps = widened(loop.F, size), np.array([widened(J, size, 1.0) for J in loop.jumps]).reshape(-1, size, size)
    rows = np.outer(forgets, asked)  # of u = asked - w
    rows[:, m:] -= np.diag(forgets)
    if loop.T:
        jumps[0][m:] += rows
    else:
        F[m:] = rows
    parts = {name: np.pad(getattr(loop, name), (0, size - m)) for name in ("B", "x", "v", "measured")}
    wider = SlidingLoop(F=F, T=loop.T, spans=loop.spans, jumps=jumps, **parts)
    return CutLoop(loop=wider, asked=asked, enters=enters, forgets=forgets)


def without_actuator(cut: CutLoop) -> SlidingLoop:
    """The same with u = 0."""
    loop, missing = cut.loop, np.outer(cut.enters, cut.asked)
    if not loop.T:
        return replace(loop, F=loop.F - missing)
    return replace(loop, jumps=np.concatenate([loop.jumps[:1] - missing, loop.jumps[1:]]))


def widened(M: np.ndarray, size: int, diagonal: float = 0.0) -> np.ndarray:
    """A square matrix as the first part of a larger one, the rest on the diagonal."""
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


def saturated(form: Dissipation, cut: CutLoop, share: float, sector: float, given: np.ndarray) -> Dissipation:
    """The inequality with its actuator; form : that of the friction, whose first states are those of the cut loop."""
    n = form.A.shape[0]
    asked, enters = (np.pad(row, (0, n - row.size)) for row in (cut.asked, cut.enters))
    seen = (share * sector + given.sum()) / 2 * asked
    seen[cut.filters] -= given / 2
    weight = float(sector + given.sum())
    if cut.loop.T:
        return replace(form, block=Block(enters=enters, seen=seen, weight=weight))
    m = form.B.shape[1]
    R = np.zeros((m + 1, m + 1))
    R[:m, :m], R[m, m] = form.R, -weight
    return replace(
        form,
        B=np.column_stack([form.B, -enters]),
        B_error=np.column_stack([form.B_error, np.zeros(n)]),
        N=np.column_stack([form.N, seen]),
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

LEAST = 1e-9  # share of a row that has to be left
SMALL = 1e-12  # of the largest weight: what is left out
ROUNDS = 60
COUPLINGS = (0.7, 0.9, 0.97, 0.99)  # of f and w, of what a definite matrix allows: slack for what the sampler folds


@value
class SaturationWeights:
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


def saturation_rows(
    cut: CutLoop, omega: np.ndarray, rates: np.ndarray, K0: float, rho: float, forgets: np.ndarray, share: float
) -> np.ndarray:
    """(W, 1 + R + 1 + J, 2, 2) hermitian forms in (f, w): friction, its filters, sector, filters of the actuator."""
    loop, s = cut.loop, 1j * omega
    none = np.zeros(loop.B.size)
    by_f, before_f = driven(loop, omega, loop.B, none)
    by_w, before_w = driven(loop, omega, none, -cut.enters) if loop.T else driven(loop, omega, -cut.enters, none)
    v, asked = np.stack([by_f, by_w], axis=1) @ loop.v, np.stack([before_f, before_w], axis=1) @ cut.asked
    f, w = np.broadcast_to([1.0, 0.0], v.shape), np.broadcast_to([0.0, 1.0], v.shape)
    rest = float(cut.asked @ loop.rest()[0]) * (rates[0] / (rates[0] + s))[:, None] * f
    columns = [product(f, v)]
    for a in rates:
        bent = (1 - a / (rho * (a - s)))[:, None] * v
        columns.append(
            product(f, bent) - (a * omega**2 / (rho * K0 * (a**2 + omega**2)))[:, None, None] * product(f, f)
        )
    each = 1 / loop.T if loop.T else 1.0  # samples a second
    columns.append(each * product(w, share * (asked - rest) - w))
    step = np.exp(s * loop.T) - 1 if loop.T else s
    columns += [each * product(w, (step / (step + phi))[:, None] * (asked - w)) for phi in forgets]
    return np.stack(columns, axis=1)


def product(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(W, 2, 2) the form Re(conj(x) y) of two linear ones (W, 2)."""
    full = np.conj(x)[:, :, None] * y[:, None, :]
    return np.asarray((full + np.conj(np.swapaxes(full, 1, 2))) / 2)


def saturation_weights(table: np.ndarray, n_rates: int) -> SaturationWeights | None:
    """Weights that make every matrix negative, few of them; None where none were found."""
    for coupling in COUPLINGS:
        found = solved(table, coupling)
        if found is not None:
            mu, sector, given = found[: n_rates + 1], float(found[n_rates + 1]), found[n_rates + 2 :]
            return SaturationWeights(mu=mu, sector=sector, given=given)
    return None


def solved(table: np.ndarray, coupling: float) -> np.ndarray | None:
    """(C,) weights of the forms, what couples f and w taken larger by 1/coupling.

    A matrix is negative where its form is, for every (f, w): a linear program over the (f, w) that were worst so far,
    again and again until none is worse.
    """
    table = table.copy()
    table[..., 0, 1] /= coupling
    table[..., 1, 0] /= coupling
    rows = [table[..., 0, 0].real, table[..., 1, 1].real]
    for _ in range(ROUNDS):
        theta, share = weights(np.concatenate(rows))
        if not share > LEAST:
            return None
        theta[theta < SMALL * theta.max()] = 0.0
        both = np.einsum("wcij,c->wij", table, theta)
        a, d, b = both[:, 0, 0].real, both[:, 1, 1].real, both[:, 0, 1]
        if not max(a.max(), d.max()) < 0:
            return None
        worse = np.abs(b) >= np.sqrt(a * d)
        if not worse.any():
            return theta
        worst = np.stack([1 / np.sqrt(-a), np.conj(b) / np.maximum(np.abs(b), 1e-300) / np.sqrt(-d)], axis=1)
        rows.append(np.einsum("wi,wcij,wj->wc", worst.conj(), table, worst).real[worse])
    return None


# ---- How far a machine is proved with an actuator that saturates: shares it may miss, tried one after another.

N_POINTS = 200
N_SETS = 2  # of filters of the friction
FORGETS = np.geomspace(1e-3, 1.0, 10)  # of a sample
RATES = np.geomspace(1e-2, 30.0, 10)  # over the reference, where nothing is sampled
#: What of asked - h an actuator may miss, at most: the larger, the further it reaches, and the harder to prove.
SHARES = (0.02, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98)
MISSES = 2  # in a row, after which larger shares are left


@value(copy=False)
class Reach:
    """A kick that is proved, and the numbers it is proved with.

    Fields
    ------
    kick, share : float
    sector : float
    forgets, weights : (J,) ndarray
        Filters of the actuator.
    numbers : dict
        Weights of the friction, and the energy.
    """

    kick: float
    share: float
    sector: float
    forgets: np.ndarray
    weights: np.ndarray
    numbers: dict[str, Any]


def reaches(machine: SlidingMachine, K: Any, friction: AnyFriction, delay: float, left: float) -> Reach | None:
    """The furthest that was found; from every state where that is proved. left : limit less friction [N]."""
    cut = cut_open(machine, K, delay)
    if cut.open_growth() < 0:
        everywhere = reach_of(machine, K, friction, delay, cut, 1.0, np.inf)
        if everywhere is not None:
            return everywhere
    best, missed = None, 0
    for share in SHARES:
        found = reach_of(machine, K, friction, delay, cut, share, left / (1 - share))
        missed = missed + 1 if found is None else 0
        if found is not None and (best is None or found.kick > best.kick):
            best = found
        if missed == MISSES and share > SHARES[MISSES]:
            break
    return best


def reach_of(
    machine: SlidingMachine, K: Any, friction: AnyFriction, delay: float, cut: CutLoop, share: float, reach: float
) -> Reach | None:
    """What is proved with one share, where anything is."""
    omega, reference = frequencies(cut.loop, N_POINTS), reference_rate(machine, cut.loop)
    fastest = 1 / friction.bristle_time if friction.bristle_time else np.inf
    forgets = FORGETS if cut.loop.T else RATES * reference
    for rates in filter_rates(reference, fastest)[:N_SETS]:
        table = saturation_rows(cut, omega, rates, friction.K0, friction.stiction, forgets, share)
        weights = saturation_weights(table, rates.size)
        if weights is None or not weights.mu[1:].any():
            continue
        own = weights.given > 0
        wider = cut_open(machine, K, delay, forgets[own])
        form = maxwell_slip_dissipation(wider.loop, rates, weights.mu, friction.K0, friction.stiction)
        form = saturated(form, wider, share, weights.sector, weights.given[own])
        failed, energy = certified_dissipation(form)
        if energy is not None and not failed:
            kick = kick_of(machine, wider, energy, reach) if np.isfinite(reach) else np.inf
            numbers = friction_numbers(rates, weights, energy)
            filters = {"forgets": forgets[own], "weights": weights.given[own]}
            return Reach(kick=kick, share=share, sector=weights.sector, numbers=numbers, **filters)
    return None


def friction_numbers(rates: np.ndarray, weights: SaturationWeights, energy: Energy) -> dict[str, Any]:
    """What a claim keeps of weights and energy."""
    used = np.append(True, weights.mu[2:] > 0)
    found = {"rates": rates[used], "weights": weights.mu[1:][used], "free": float(weights.mu[0])}
    nothing = {"block": np.zeros((0, 0)), "bounds": np.zeros(0)}  # of bristles
    return found | nothing | {name: getattr(energy, name) for name in ("V", "P", "counts")}


def kick_of(machine: SlidingMachine, cut: CutLoop, energy: Energy, reach: float) -> float:
    """The kick [m/s] up to which an energy keeps what is asked for within reach [N]."""
    size = energy.V.shape[0]
    hit = np.zeros(size)
    hit[: machine.A.shape[0]] = machine.B_port / (machine.velocity @ machine.B_port)
    return kick_within(energy, np.pad(cut.asked, (0, size - cut.asked.size)), hit, reach)


SUBJECT = "the stored energy falls, the actuator saturated or not"
NOT_CLAIMED = (
    "Not claimed: {other}friction above {Fs:g} N, an actuator of less than {limit:g} N, quantisation, another linear "
    "part."
)
NOTHING = "Not claimed: anything with an actuator that saturates."


@value
class SaturatedProof:
    """What is proved of a loop around a machine with friction whose actuator saturates.

    Fields
    ------
    verdict : FrictionVerdict
        "proved": from every state. "proved up to a kick": from rest, relaxed, up to `kick`; beyond it nothing is said.
        "refuted": without saturation already, of the class and not of the machine. "not decided".
    claim, not_claimed, reason : str
        What is proved, in one sentence; what is not; why the verdict is what it is.
    friction : AnyFriction
        The class.
    Fs, limit : float
        Largest friction force and largest force of the actuator [N].
    kick : float
        Velocity at the friction port [m/s] of a kick on the machine at rest and relaxed, up to which it comes to rest;
        infinite where it does from every state, zero where no kick is proved.
    kick_linear : float
        The part of it up to which the actuator never saturates at all [m/s].
    share : float
        What of the force that is asked for, less what holds the friction, the actuator may miss on the way; one where
        it may miss all of it, zero where it never saturates.
    certificate : Certificate or None
        What was judged; `certificate.verify()` proves it again over the rationals. With a share of zero that of the
        loop that does not saturate.

    References
    ----------
    S. Tarbouriech, G. Garcia, J. Gomes da Silva, I. Queinnec, *Stability and Stabilization of Linear Systems with
    Saturating Actuators*, Springer, 2011 (sectors that hold on a region).

    Examples
    --------
    >>> from robust import any_maxwell_slip, sliding_machine
    >>> rig = sliding_machine(1.0, 80e3, 40.0)
    >>> prove_saturated(rig, 1e3, any_maxwell_slip(64e3), Fs=1.0, limit=20.0).verdict
    'proved'
    """

    verdict: FrictionVerdict
    claim: str
    not_claimed: str
    reason: str
    friction: AnyFriction
    Fs: float
    limit: float
    kick: float
    kick_linear: float
    share: float
    certificate: Certificate | None

    def __str__(self) -> str:
        said = self.claim if self.verdict.is_proved else self.reason
        more = [self.reason] if self.verdict.is_proved and self.reason else []
        return "\n".join([f"{self.verdict}: {said}", *more, self.not_claimed])


def prove_saturated(
    machine: SlidingMachine, K: Any, friction: AnyFriction, *, Fs: float, limit: float, delay: float = 0.0
) -> SaturatedProof:
    """Prove that a loop comes to rest with every friction of a class though its actuator saturates, or up to a kick.

    Parameters
    ----------
    machine : SlidingMachine
        The linear part, from `sliding_machine`.
    K : control.StateSpace, TransferFunction or float
        Controller, u = K (r - y), without anti-windup; sampled, or continuous and proper.
    friction : AnyFriction
        The class: `any_maxwell_slip`; of `any_bristle` only how far the actuator never saturates.
    Fs : float
        Largest friction force [N].
    limit : float
        Largest force of the actuator [N], more than Fs.
    delay : float
        From sampling to the force changing [s].

    Returns
    -------
    SaturatedProof
        A numerical failure is "not decided", with its reason.

    Raises
    ------
    ValueError
        As `prove_friction`; another class; a limit that is not above Fs.

    References
    ----------
    Tarbouriech and others, 2011; P. Park, *Stability criteria of sector- and slope-restricted Lur'e systems*, IEEE
    Trans. Automatic Control 47, 2002.

    Examples
    --------
    >>> import control
    >>> from robust import any_maxwell_slip, sliding_machine
    >>> PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)         # 20 kN/m and 60 Ns/m at 1 kHz
    >>> proof = prove_saturated(sliding_machine(1.0, 80e3, 0.4), PD, any_maxwell_slip(64e3), Fs=1.0, limit=20.0)
    >>> proof.verdict, proof.kick > 2 * proof.kick_linear
    ('proved up to a kick', True)
    """
    Fs, limit = positive("Fs", Fs), positive("limit", limit)
    if not limit > Fs:
        raise ValueError(f"limit must be above Fs, the largest friction force, got {limit:g} N and Fs = {Fs:g} N")
    plain = prove_friction(machine, K, friction, delay=delay)
    machine, delay = separate_delay(machine, delay)
    if friction.kind not in ("Maxwell slip", "bristle"):
        raise ValueError(f"friction must be any_maxwell_slip(...) or any_bristle(...), got {friction.words}")
    known: dict[str, Any] = {"friction": friction, "Fs": Fs, "limit": limit}
    if plain.verdict is not FrictionVerdict.PROVED:
        return nothing(plain.verdict, f"without saturation: {plain.reason}", known)
    K = state_space("K", K)
    cut = cut_open(machine, K, delay)
    rest, offset = cut.loop.rest()
    left = limit - Fs * float(abs(cut.asked @ rest) + np.abs(cut.asked) @ offset)
    if left <= 0:
        return nothing(FrictionVerdict.NOT_DECIDED, "holding the friction takes all of the limit", known)
    if not machine.velocity @ machine.B_port > 0:
        return nothing(FrictionVerdict.NOT_DECIDED, "a kick at the friction port moves no velocity at once", known)
    try:
        linear = certify(cut.loop, friction, reference_rate(machine, cut.loop)).energy
        kick_linear = 0.0 if linear is None else kick_of(machine, cut, linear, left)
        reach = reaches(machine, K, friction, delay, left) if friction.kind == "Maxwell slip" else None
    except (np.linalg.LinAlgError, ValueError, FloatingPointError) as error:
        return nothing(FrictionVerdict.NOT_DECIDED, f"numerical failure: {error}", known)
    everywhere = np.isinf(kick_linear) or (reach is not None and reach.share == 1)
    certificate, kick, share = plain.certificate, kick_linear, 0.0
    if reach is not None and reach.kick > kick_linear:
        exact = claimed(machine, K, delay, friction, reach.numbers)
        certificate, kick, share = certificate_of(exact, reach, known), reach.kick, reach.share
    return SaturatedProof(
        verdict=FrictionVerdict.PROVED if everywhere else FrictionVerdict.PROVED_LOCALLY,
        claim=claim(np.inf if everywhere else kick, scope(machine, friction, K, delay), Fs, limit),
        reason="" if everywhere else why_local(cut, friction),
        not_claimed=NOT_CLAIMED.format(other=OTHER[friction.kind], Fs=Fs, limit=limit),
        kick=kick,
        kick_linear=kick_linear,
        share=share,
        certificate=certificate,
        **known,
    )


def nothing(verdict: FrictionVerdict, reason: str, known: dict[str, Any]) -> SaturatedProof:
    """Nothing is proved with the actuator."""
    numbers: dict[str, Any] = {"kick": 0.0, "kick_linear": 0.0, "share": 0.0, "certificate": None}
    return SaturatedProof(verdict=verdict, claim="", not_claimed=NOTHING, reason=reason, **numbers, **known)


def certificate_of(claim: FrictionClaim, reach: Reach, known: dict[str, Any]) -> Certificate:
    """What was judged, with the actuator in it."""
    kick = reach.kick if np.isfinite(reach.kick) else 0.0
    limits: dict[str, float] = {"limit": known["limit"], "Fs": known["Fs"], "kick": kick, "share": reach.share}
    actuator = Actuator(sector=reach.sector, forgets=reach.forgets, weights=reach.weights, **limits)
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


def claim(kick: float, scope: str, Fs: float, limit: float) -> str:
    """What is proved, in one sentence: from every state where the kick is infinite, else up to that kick."""
    rest = "Comes to rest from every state"
    if np.isfinite(kick):
        hit = f"a kick of at most {1e3 * kick:.3g} mm/s at the friction port"
        rest = f"At rest and relaxed, comes to rest again after {hit}"
    return f"{rest} {scope}, with an actuator of {limit:g} N and friction of at most {Fs:g} N."


def why_local(cut: CutLoop, friction: AnyFriction) -> str:
    """Why it is not proved from every state."""
    if friction.kind != "Maxwell slip":
        return f"From every state: not tried for a {friction.kind}; the kick is one that never saturates the actuator."
    if cut.open_growth() < 0:
        return "From every state: no weights were found for all that an actuator may miss."
    return (
        "From every state: not to be had by a quadratic energy. With the actuator at its limit the loop is open and "
        "does not come to rest by itself (a controller that integrates without anti-windup, a machine without damping)."
    )
