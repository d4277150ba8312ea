"""The friction proof for a saturated actuator, from every state or up to an initial velocity."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from nlfrf._base.arguments import require_positive
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust._base.types import Controller
from robust.friction.exact.claim import Actuator
from robust.friction.exact.classes import MaxwellSlipPort
from robust.friction.loop import FrictionLoop, driven_states, friction_loop, loop_frequencies
from robust.friction.plant import FrictionPlant, require_one_port
from robust.friction.proof.certify import build_claim, certificate_of, reference_rate
from robust.friction.proof.dissipation import maxwell_slip_dissipation
from robust.friction.proof.multipliers import (
    filter_rates,
    friction_forms,
    hermitian_product,
    negative_multipliers,
    weighed_port,
)
from robust.friction.proof.protocol import (
    CertifiedClass,
    FrictionCertificate,
    FrictionClass,
    FrictionProof,
    ProofTask,
    SaturatedActuator,
)
from robust.friction.proof.storage import Block, Dissipation, JudgedStorage, certified_dissipation
from robust.lti.realisation import state_space

if TYPE_CHECKING:
    pass

# ---- The initial velocity up to which an actuator suffices: the energy falls, and it bounds the
# commanded force.
#
# At rest and relaxed, an initial velocity e v0 adds at most v0^2 e'P e of energy at any instant.
# The commanded force is c'y + h, with h the force that holds the friction, and |c'y| <= sqrt(E
# c'M^-1 c) while the energy y'My is at most E.

_ROUNDED_DOWN = 0.99  # far more than the rounding in E^-1


def _velocity_within_reach(
    machine: FrictionPlant, cut: _LureLoop, *, energy: JudgedStorage, reach: float
) -> float:
    """Return the initial velocity [m/s] up to which a storage keeps the commanded force within
    reach [N].

    It is infinite if the commanded force depends on no state.
    """
    if not cut.command_row.any():
        return np.inf
    size, n, m = energy.V.shape[0], machine.A.shape[0], cut.command_row.size
    hit, read = np.zeros(size), np.zeros(energy.stored.shape[0])
    hit[:n] = machine.B_port / (machine.velocity @ machine.B_port)  # change of the state for 1 m/s
    read[:size] = energy.V[:m].T @ cut.command_row
    whole = energy.stored.copy()
    whole[:size, :size] += energy.P[-1, -1]  # just before a sample, when the force is commanded
    unit = 1 / np.sqrt(np.diag(whole))
    peak_command = (unit * read) @ np.linalg.solve(whole * np.outer(unit, unit), unit * read)
    start = np.linalg.solve(energy.V, hit)
    put_in = float(np.einsum("i,...ij,j", start, energy.P, start).max())
    return float(_ROUNDED_DOWN * reach / np.sqrt(peak_command * put_in))


# ---- The loop opened at an actuator that saturates: the commanded force, and the input of the
# saturation deficit.
#
# The actuator delivers u = sat(command). The deficit is w = command - u, so that y+ = J y -
# input_column w at a sample (y' = F y - input_column w for a continuous controller). Filters of the
# delivered force extend the state of the loop: u_j+ = u_j + phi_j (u - u_j), or u_j' = phi_j (u -
# u_j). The proof uses them; the machine does not contain them.


@value
class _LureLoop:
    """A sliding loop opened at its actuator (Lur'e system), with filters of the force."""

    loop: FrictionLoop  # the filters are its last states
    command_row: np.ndarray  # (n,) commanded force, as a row on the state before a sample
    # (n,) column through which the saturation deficit enters with a minus sign: at a sample, or in
    # the flow
    input_column: np.ndarray
    forgets: np.ndarray  # (J,) rates phi_j of the filters: a share of each sample, or [1/s]

    def open_growth(self) -> float:
        """Return the growth of the loop with its actuator off, which delivers nothing; negative for
        a stable loop.
        """
        missing = np.outer(self.input_column, self.command_row)
        if not self.loop.T:
            return replace(self.loop, F=self.loop.F - missing).growth()
        first, *others = self.loop.jumps
        return replace(self.loop, jumps=np.array([first - missing, *others])).growth()


def _open_at_actuator(
    machine: FrictionPlant, K: Controller, delay: float, forgets: np.ndarray | None = None
) -> _LureLoop:
    """Open the loop u = -K y at its actuator, and add filters with the given rates.

    >>> from robust.friction.plant import friction_plant
    >>> cut = _open_at_actuator(friction_plant(1.0, 80e3, 0.4), 2e3, 0.0)
    >>> (0 + cut.command_row).tolist(), cut.input_column.tolist()  # on displacement and velocity
    ([-2000.0, 0.0], [0.0, 1.0])
    """
    K = state_space("K", K)
    loop = friction_loop(machine, K, delay)
    if forgets is None:
        forgets = np.zeros(0)
    n, m, s = machine.A.shape[0], loop.F.shape[0], K.nstates
    size = m + forgets.size
    command_row, input_column = np.zeros(size), np.zeros(size)
    command_row[:n] = -K.D[0, 0] * machine.C_measured
    command_row[m - s : m] = K.C[0] if s else 0.0
    if loop.T:
        input_column[n + 1 if m > n + 1 + s else n] = (
            1.0  # the force that waits, or the one that is held
        )
    else:
        input_column[:n] = machine.B_force
    input_column[m:] = forgets
    own = np.eye(forgets.size)
    F = block_diag(loop.F, 0 * own)
    jumps = np.array([block_diag(J, own) for J in loop.jumps]).reshape(-1, size, size)
    rows = np.outer(forgets, command_row)  # of u = command - w
    rows[:, m:] -= np.diag(forgets)
    if loop.T:
        jumps[0][m:] += rows
    else:
        F[m:] = rows
    parts = {
        name: np.pad(getattr(loop, name), (0, size - m)) for name in ("B", "x", "v", "measured")
    }
    wider = FrictionLoop(F=F, T=loop.T, spans=loop.spans, jumps=jumps, **parts)
    return _LureLoop(
        loop=wider, command_row=command_row, input_column=input_column, forgets=forgets
    )


# ---- The dissipation inequality of a friction class with an actuator that saturates, in states
# that come to rest.
#
# With y the state minus its rest, u - h = c'y - w and weights theta, the inequality of the friction
# gains the term
#
#     theta_0 w (share c'y - w) + sum theta_j w (c'y - w - u_j)
#
# at every sample, or in the flow with w as one more input. An actuator never makes this term
# negative.


def _with_saturation(
    form: Dissipation, cut: _LureLoop, *, share: float, sector: float, given: np.ndarray
) -> Dissipation:
    """Add the dead zone to the dissipation inequality `form`, whose first states are those of the
    open loop.
    """
    n = form.A.shape[0]
    command_row, input_column = (
        np.pad(row, (0, n - row.size)) for row in (cut.command_row, cut.input_column)
    )
    output_row = (share * sector + given.sum()) / 2 * command_row
    size = cut.command_row.size
    output_row[size - given.size : size] -= given / 2
    weight = float(sector + given.sum())
    if cut.loop.T:
        return replace(
            form, block=Block(input_column=input_column, output_row=output_row, weight=weight)
        )
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


# ---- Weights for a friction class and an actuator that saturates, together, by linear programs
# over frequency.
#
# The deficit w = command - u satisfies at every instant, for filters u_j of the delivered force,
#
#     w (share (command - h) - w) >= 0    while (1 - share) |command - h| is at most the limit minus
#     the friction
#     w (u - u_j)                 >= 0    because a mean of the past never exceeds the limit
#
# with h the force that holds the friction at rest. With the terms of the friction they make one
# hermitian matrix in (f, w) at each frequency. Nothing here is a proof.

_MIN_SHARE = 1e-9  # share of a row that must remain
_COUPLINGS = (
    0.7,
    0.9,
    0.97,
    0.99,
)  # of f and w, relative to a definite matrix: slack for the aliases of the sampler


def _saturation_terms(
    cut: _LureLoop,
    omega: np.ndarray,
    *,
    rates: np.ndarray,
    K0: float,
    rho: float,
    forgets: np.ndarray,
    share: float,
) -> np.ndarray:
    """Return (W, 1 + R + 1 + J, 2, 2) hermitian forms in (f, w): friction, its filters, sector,
    actuator filters.
    """
    loop, s = cut.loop, 1j * omega
    none = np.zeros(loop.B.size)
    by_f, before_f = driven_states(loop, omega, flow=loop.B, struck=none)
    if loop.T:
        by_w, before_w = driven_states(loop, omega, flow=none, struck=-cut.input_column)
    else:
        by_w, before_w = driven_states(loop, omega, flow=-cut.input_column, struck=none)
    v = np.stack([by_f, by_w], axis=1) @ loop.v
    command_row = np.stack([before_f, before_w], axis=1) @ cut.command_row
    f, w = np.broadcast_to([1.0, 0.0], v.shape), np.broadcast_to([0.0, 1.0], v.shape)
    rest = float(cut.command_row @ loop.rest()[0]) * (rates[0] / (rates[0] + s))[:, None] * f
    columns = friction_forms(f, v, omega=omega, rates=rates, K0=K0, rho=rho)
    each = 1 / loop.T if loop.T else 1.0  # samples a second
    columns.append(each * hermitian_product(w, share * (command_row - rest) - w))
    if loop.T:
        step = np.exp(s * loop.T) - 1
    else:
        step = s
    columns += [
        each * hermitian_product(w, (step / (step + phi))[:, None] * (command_row - w))
        for phi in forgets
    ]
    return np.stack(columns, axis=1)


# ---- The largest region that is proved with an actuator that saturates: sector gains tried one
# after another.

_N_POINTS = 200
_N_SETS = 2  # of filters of the friction
_FILTER_SHARES = np.geomspace(1e-3, 1.0, 10)  # of a sample
_FILTER_RATES = np.geomspace(
    1e-2, 30.0, 10
)  # relative to the reference, for a continuous controller
#: Share of command - h that an actuator may fail to deliver: a larger one gives a larger region and
#: a harder proof.
_SECTOR_GAINS = (0.02, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98)
_MAX_FAILURES = 2  # in a row, after which larger sector gains are not tried


def largest_region(
    task: ProofTask, limits: MaxwellSlipPort, known: Actuator, left: float
) -> FrictionCertificate:
    """Return the largest region of attraction that is found, and why it is not every state.

    limits : the class, without weights. left : limit minus friction [N].
    """
    cut = _open_at_actuator(task.machine, task.K, task.delay)

    def region(share: float) -> FrictionCertificate:
        return _region_for_sector(task, limits, cut, replace(known, share=share), left)

    why = (
        "a quadratic energy cannot prove it. With the actuator at its limit the loop is open and"
        " does not come to rest by itself (a controller that integrates without anti-windup, a"
        " machine without damping)."
    )
    if cut.open_growth() < 0:
        why = "no weights were found for an actuator that may fail to deliver all of its force."
        everywhere = region(1.0)
        if everywhere.energy is not None:
            return everywhere
    best, missed = FrictionCertificate(why), 0
    for share in _SECTOR_GAINS:
        found = region(share)
        if found.energy is None:
            missed = missed + 1
        else:
            missed = 0
        if found.kick > best.kick:
            best = found._replace(reason=why)
        if missed == _MAX_FAILURES and share > _SECTOR_GAINS[_MAX_FAILURES]:
            break
    return best


def _region_for_sector(
    task: ProofTask, limits: MaxwellSlipPort, cut: _LureLoop, known: Actuator, left: float
) -> FrictionCertificate:
    """Return the region that is proved with the sector gain `known.share`, if one is."""
    omega, reference = loop_frequencies(cut.loop, _N_POINTS), reference_rate(task.machine, cut.loop)
    if cut.loop.T:
        forgets = _FILTER_SHARES
    else:
        forgets = _FILTER_RATES * reference
    for rates in filter_rates(reference, limits.bristle_time)[:_N_SETS]:
        table = _saturation_terms(
            cut,
            omega,
            rates=rates,
            K0=limits.K0,
            rho=limits.stiction,
            forgets=forgets,
            share=known.share,
        )
        theta = negative_multipliers(table, couplings=_COUPLINGS, least=_MIN_SHARE)
        if theta is None or not theta[1 : rates.size + 1].any():
            continue
        mu = theta[: rates.size + 1]
        sector = float(theta[rates.size + 1])
        given = theta[rates.size + 2 :]
        own = given > 0
        wider = _open_at_actuator(task.machine, task.K, task.delay, forgets[own])
        form = maxwell_slip_dissipation(wider.loop, rates, mu=mu, K0=limits.K0, rho=limits.stiction)
        form = _with_saturation(form, wider, share=known.share, sector=sector, given=given[own])
        failed, energy = certified_dissipation(form)
        if energy is not None and not failed:
            kick = 0.0  # meaningless for a proof from every state
            if known.share < 1:
                kick = _velocity_within_reach(
                    task.machine, wider, energy=energy, reach=left / (1 - known.share)
                )
            actuator = replace(
                known, kick=kick, sector=sector, forgets=forgets[own], weights=given[own]
            )
            return FrictionCertificate("", (weighed_port(rates, limits, mu),), energy, actuator)
    return FrictionCertificate("no region")


_NOT_CLAIMED = (
    "{other}friction above {Fs:g} {unit}, an actuator of less than {limit:g} {unit}, quantisation,"
    " another linear part."
)
_NO_ACTUATOR_CLAIM = "anything with an actuator that saturates."


def limits_of_force(
    machine: FrictionPlant, friction: FrictionClass, forces: np.ndarray, saturation: float
) -> Actuator:
    """Return the actuator of a claim; raise for a class or a force without a proof."""
    require_one_port(machine)
    if not isinstance(friction, CertifiedClass):
        raise ValueError(
            f"saturation must be left out for {friction.description}, because no proof with"
            " saturation exists for it, got one"
        )
    limit = require_positive("saturation", saturation)
    Fs = float(forces[0])
    unit = friction.units.force
    if not limit > Fs:  # nan: not given
        raise ValueError(
            f"saturation must be above Fs, the largest friction force, got {limit:g} {unit} and Fs"
            f" = {Fs:g} {unit}"
        )
    return Actuator(
        limit=limit,
        Fs=Fs,
        kick=0.0,
        share=0.0,
        sector=0.0,
        forgets=np.zeros(0),
        weights=np.zeros(0),
    )


def with_actuator(plain: FrictionProof, task: ProofTask, known: Actuator) -> FrictionProof:
    """Return the proof with the actuator, made from the proof without it."""
    machine, (friction,) = task.machine, plain.friction
    assert isinstance(friction, CertifiedClass)  # `limits_of_force` refuses another

    def nothing(verdict: FrictionVerdict, reason: str) -> FrictionProof:
        return replace(
            plain,
            verdict=verdict,
            reason=reason,
            certificate=None,
            not_claimed=_NO_ACTUATOR_CLAIM,
            actuator=SaturatedActuator(limit=known.limit),
        )

    if plain.verdict is not FrictionVerdict.PROVED:
        return nothing(plain.verdict, f"without saturation: {plain.reason}")
    cut = _open_at_actuator(machine, task.K, task.delay)
    rest, offset = cut.loop.rest()
    left = known.limit - known.Fs * float(
        abs(cut.command_row @ rest) + np.abs(cut.command_row) @ offset
    )
    if left <= 0:
        return nothing(FrictionVerdict.NOT_DECIDED, "the friction alone uses up the limit")
    if not machine.velocity @ machine.B_port > 0:
        return nothing(
            FrictionVerdict.NOT_DECIDED,
            "a force at the friction port does not change the velocity at once",
        )
    kick, share, certificate = 0.0, 0.0, plain.certificate
    try:
        linear = friction.certify(cut.loop, reference_rate(machine, cut.loop)).energy
        if linear is not None:
            kick = _velocity_within_reach(machine, cut, energy=linear, reach=left)
        found = friction.region(task, known, left)
    except (np.linalg.LinAlgError, ValueError, FloatingPointError) as error:
        return nothing(FrictionVerdict.NOT_DECIDED, f"numerical failure: {error}")
    kick_linear = kick
    if found.actuator is not None and found.energy is not None and found.kick > kick:
        share, kick = found.actuator.share, found.kick
        exact = build_claim(task, found.ports, found.energy)
        certificate = certificate_of(replace(exact, actuator=found.actuator))
    everywhere = bool(np.isinf(kick))
    unit = friction.units.force
    return replace(
        plain,
        verdict=FrictionVerdict.PROVED if everywhere else FrictionVerdict.PROVED_LOCALLY,
        reason="" if everywhere else f"From every state: {found.reason}",
        not_claimed=_NOT_CLAIMED.format(
            other=friction.excluded, Fs=known.Fs, limit=known.limit, unit=unit
        ),
        certificate=certificate,
        actuator=SaturatedActuator(
            limit=known.limit, kick=kick, kick_linear=kick_linear, share=share
        ),
    )
