"""Bristles that bend and creep: multipliers from a cone program, dissipation inequality."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Self, TypeAlias

import numpy as np
from scipy.optimize import minimize_scalar

from nlfrf._base.arguments import require_nonnegative, require_positive
from nlfrf._base.values import value
from robust.friction.exact.classes import BristlePort
from robust.friction.loop import FrictionLoop, loop_frequencies, mobility
from robust.friction.proof.certify import certified_verdict, settled_by_bound
from robust.friction.proof.multipliers import filter_rates, hermitian_product
from robust.friction.proof.protocol import (
    CertifiedClass,
    FrictionCertificate,
    FrictionProof,
    ProofTask,
    require_stiction,
)
from robust.friction.proof.storage import Dissipation, certified_dissipation
from robust.proofs.search.programs import solve_program

if TYPE_CHECKING:
    import cvxpy

_N_POINTS = 300  # of the frequencies of the cone program


@value(kw_only=False)
class Bristle(CertifiedClass):
    """Class of friction laws with bristles that bend and creep, such as LuGre and Leuven.

    The friction force is f = F + microdamping z', with the bristle deflection z. F is a hysteresis
    of z (by Masing's rules) with a slope of at most K0. The bristles slip at the velocity p: z' = v
    - p with F p >= 0 and |p| <= stiction |v|.

    Use this class for friction that creeps below break-away. It contains:

    - LuGre, with K0 = sigma0, stiction = Fs/Fc and microdamping = sigma1;
    - the modified Leuven model, with K0 = slope of its hysteresis curve at zero, stiction =
      (Fs/Fc)^n and microdamping = sigma1;
    - Dahl's model with exponent n = 1, with stiction = 1.

    Fields
    ------
    K0 : float
        Largest stiffness of the bristles [N/m].
    stiction : float
        Largest ratio of slip velocity to velocity of the machine; at least 1.
    microdamping : float
        Damping sigma1 of the bristles [Ns/m]; every law of the class has this value.
    position_unit : str
        "m", or "rad" with Nm.

    Raises
    ------
    ValueError
        A stiffness that is not positive, a stiction below one, or a negative damping.

    References
    ----------
    C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automatic Control 40,
    1995 (bristles).

    Examples
    --------
    >>> Bristle(64e3, 1 / 0.7, 13.0).microdamping              # the rig of the paper
    13.0
    """

    K0: float
    stiction: float = 1.5
    microdamping: float = 0.0

    excluded: ClassVar[str] = "rigid stiction, another damping of the bristles, "
    stuck_element: ClassVar[str] = "a bristle"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "K0", require_positive("K0", self.K0))
        object.__setattr__(self, "stiction", require_stiction(self.stiction))
        object.__setattr__(
            self, "microdamping", require_nonnegative("microdamping", self.microdamping)
        )

    @property
    def description(self) -> str:
        """Noun phrase for the laws of the class, for texts."""
        return (
            f"bristle friction with a stiffness up to {self.K0 / 1e3:.4g} {self.units.stiffness}"
            f" and a damping of {self.microdamping:g} {self.units.damping}, whose bristles creep"
            f" against their force (at most {self.stiction:.4g} times as fast as the machine moves)"
        )

    def stuck(self) -> tuple[float, float]:
        """Return stiffness [N/m] and damping [Ns/m] of the stiffest bristle that never creeps."""
        return self.K0, self.microdamping

    def decide(
        self, undecided: FrictionProof, task: ProofTask, others: Sequence[Self] = ()
    ) -> FrictionProof:
        """Return "proved" if a decreasing storage function is found, else the bound on the error."""
        return settled_by_bound(certified_verdict(undecided, task, self.certify))

    def certify(
        self, loop: FrictionLoop, reference: float, others: Sequence[Self] = ()
    ) -> FrictionCertificate:
        """Search multipliers for creeping bristles, and certify them."""
        omega = loop_frequencies(loop, _N_POINTS)
        response = mobility(loop, omega)
        reason = "no multiplier weights make the loop dissipate at every frequency"
        for rates in filter_rates(reference)[:2]:
            table = _bristle_terms(
                response, omega, rates=rates, K0=self.K0, microdamping=self.microdamping
            )
            port = _bristle_multipliers(table, rates, self)
            if port is None:
                continue
            reason, energy = certified_dissipation(_bristle_dissipation(loop, port))
            if not reason:
                return FrictionCertificate("", (port,), energy)
        return FrictionCertificate(reason)


# ---- Weights for the friction of bristles that creep, by one cone program over the frequencies.
#
# The bristle z bends with the velocity v minus a creep p: z' = q = v - p, F p >= 0, |p| <= rho |v|;
# F is a hysteresis of z with slopes up to K0, f = F + sigma q. These forms in gamma = F'/K0 and q
# have integrals bounded from below:
#
#     F v                                      with weight mu
#     -e_j q - (a_j/K0) e_j^2                  with weights nu_j; e_j = Fh_j - F, Fh_j' = a_j (F -
#     Fh_j)
#     (v, q, gamma) M (v, q, gamma)'           q between (1 - rho) v and (1 + rho) v, gamma between
#     0 and q
#
# The loop turns them into one hermitian matrix a frequency. Nothing here is a proof.

BLOCK_ENTRIES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # entries of M
_MIN_SHARE = 1e-7  # share of a row that the solver must leave
_SOLVER_TOLERANCE = (
    1e-9  # of M, added in the direction that makes the form larger: the tolerance of the solver
)
_NEGLIGIBLE_WEIGHTS = (
    1e-2,
    1e-4,
    1e-6,
)  # relative to the largest weight; filters below are left out


def _bristle_terms(
    mobility: np.ndarray, omega: np.ndarray, *, rates: np.ndarray, K0: float, microdamping: float
) -> np.ndarray:
    """Return (W, 1 + J + 6, 2, 2) hermitian forms in (gamma, q): of F v, of each filter and of each
    entry of M.
    """
    s = 1j * omega
    zero, one = np.zeros_like(s), np.ones_like(s)
    F, q, gamma = (np.stack(pair, axis=1) for pair in ((K0 / s, zero), (zero, one), (one, zero)))
    v = mobility[:, None] * (F + microdamping * q)
    columns = [hermitian_product(F, v)]
    for a in rates:
        e = -K0 / (a + s)[:, None] * gamma
        columns.append(-hermitian_product(e, q) - a / K0 * hermitian_product(e, e))
    y = v, q, gamma
    columns += [hermitian_product(y[i], y[j]) * (1 if i == j else 2) for i, j in BLOCK_ENTRIES]
    return np.stack(columns, axis=1)


def _bristle_multipliers(
    table: np.ndarray, rates: np.ndarray, friction: Bristle
) -> BristlePort | None:
    """Return multipliers that make every matrix most negative relative to its entries; None if
    there are none.

    The program is solved twice, the second time with the filters of large weight only: an
    interior-point solver leaves none at zero.
    """
    rho = friction.stiction
    theta = _solve_multipliers(table, rho)
    if theta is None:
        return None
    n = theta.size
    kept = np.arange(n) >= n - 6
    for small in _NEGLIGIBLE_WEIGHTS:
        kept[: n - 6] = theta[: n - 6] > small * np.abs(theta).max()
        again = _solve_multipliers(table[:, kept], rho)
        if again is not None:
            break
    else:
        return None
    found = np.zeros(n)
    found[kept] = again / _term_sizes(table[:, kept])[1]
    block, bounds = _enlarge_block(found[n - 6 :], rho)
    nu = found[1 : n - 6]
    return BristlePort(
        K0=friction.K0,
        stiction=rho,
        microdamping=friction.microdamping,
        free=max(float(found[0]), 0.0),
        rates=rates[nu > 0],
        weights=nu[nu > 0],
        block=block,
        bounds=bounds,
    )


def _term_sizes(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (W, 2) units of gamma and q at each frequency, and (C,) the largest size of each form
    in these units.
    """
    unit = 1 / np.sqrt(np.abs(np.diagonal(table, axis1=2, axis2=3)).max(axis=1))
    return unit, np.abs(table * unit[:, None, :, None] * unit[:, None, None, :]).max(axis=(0, 2, 3))


def _solve_multipliers(table: np.ndarray, rho: float) -> np.ndarray | None:
    """Return (C,) the multipliers of the cone solver, relative to the sizes of the forms; None if
    they fail.
    """
    import cvxpy as cp

    unit, scale = _term_sizes(table)
    table = table * unit[:, None, :, None] * unit[:, None, None, :] / scale[:, None, None]
    a, d, b = table[..., 0, 0].real, table[..., 1, 1].real, table[..., 0, 1]
    n = scale.size
    theta, share, bounds = cp.Variable(n), cp.Variable(), cp.Variable(2, nonneg=True)
    M = [theta[n - 6 + k] / scale[n - 6 + k] for k in range(6)]
    constraints = [
        cp.SOC(
            -(a + d) @ theta - 2 * share,
            cp.vstack([2 * b.real @ theta, 2 * b.imag @ theta, (a - d) @ theta]),
        ),
        M[5] <= 0,
        cp.norm(theta, 1) <= 1,
        *([theta[: n - 6] >= 0] if n > 6 else []),
    ]
    for i, form in enumerate(_block_at_ends(M)):
        p, cross, r = (x - bounds[i] * y for x, y in zip(form, _sector_form(rho), strict=True))
        constraints.append(cp.SOC(p + r, cp.hstack([2 * cross, p - r])))
    solve_program(cp.Problem(cp.Maximize(share), constraints), "CLARABEL")
    if theta.value is None or share.value is None or not share.value > _MIN_SHARE:
        return None
    return np.asarray(theta.value)


#: Entries (v, v), (v, q), (q, q) of a form: numbers, or expressions of a convex program.
Entries: TypeAlias = (
    "tuple[float | cvxpy.Expression, float | cvxpy.Expression, float | cvxpy.Expression]"
)


def _block_at_ends(M: np.ndarray | cvxpy.Variable) -> tuple[Entries, Entries]:
    """Return the form of M in (v, q) at gamma = 0 and at gamma = q: entries (v, v), (v, q),
    (q, q).
    """
    return (M[0], M[1], M[3]), (M[0], M[1] + M[2], M[3] + 2 * M[4] + M[5])


def _sector_form(rho: float) -> tuple[float, float, float]:
    """Return the form (q - (1 - rho) v)((1 + rho) v - q), entry by entry."""
    return rho**2 - 1, 1.0, -1.0


def _enlarge_block(entries: np.ndarray, rho: float) -> tuple[np.ndarray, np.ndarray]:
    """Enlarge M by the tolerance of the solver, so that its form is nonnegative for all possible q
    and gamma.
    """
    M = np.array(entries)
    M[5] = min(M[5], 0.0)
    bounds, left = np.zeros(2), 0.0
    for i, form in enumerate(_block_at_ends(M)):
        bounds[i], below = _sector_multiple(form, rho)
        left = max(left, below)
    M[[0, 3]] += left + _SOLVER_TOLERANCE * np.abs(M).max()
    block = np.zeros((3, 3))
    for (i, j), entry in zip(BLOCK_ENTRIES, M, strict=True):
        block[i, j] = block[j, i] = entry
    return block, bounds


def _sector_multiple(form: tuple[float, float, float], rho: float) -> tuple[float, float]:
    """Return the largest multiple of the sector form below a form in (v, q), and the deficit."""

    def below(multiple: float) -> float:
        p, cross, r = (x - multiple * y for x, y in zip(form, _sector_form(rho), strict=True))
        return float(
            np.hypot((p - r) / 2, cross) - (p + r) / 2
        )  # minus the least eigenvalue, a convex function

    top = 1.0 + 8 * np.abs(form).max()
    found = minimize_scalar(
        below, bounds=(0.0, top), method="bounded", options={"xatol": 1e-12 * top}
    )
    multiple = min((0.0, float(found.x)), key=below)
    return multiple, max(below(multiple), 0.0)


# ---- The dissipation inequality of creeping bristles, in states that come to rest where the
# machine does.
#
# With y = xi - F xi_e, F the elastic force and xi_e the rest under f = 1, with e_j = Fh_j - F, and
# inputs gamma = F'/K0 and q = z',
#
#     y' = F_loop y - K0 xi_e gamma + sigma B q,   e_j' = -a_j e_j - K0 gamma,   jump: J on y
#
# and the class guarantees d/dt [S - mu (F y_x + F^2 x_e/2)] <= Supply(z, gamma, q), where
#
#     Supply = -mu K0 gamma y_x - sum nu_j (e_j q + (a_j/K0) e_j^2) + (v, q, gamma) M (v, q, gamma)'
#
# and S >= mu F^2/(2 K0) + sum nu_j e_j^2/(2 K0). With mu = 0 (a circle criterion for the slopes)
# the energy is a form in z alone: z and the inputs decay exponentially, so F = F(0) + int K0 gamma
# converges too.


def _bristle_dissipation(loop: FrictionLoop, port: BristlePort) -> Dissipation:
    """Return the inequality for a loop with the weights of its forms."""
    a, nu, mu, M, K0 = port.rates, port.weights, port.free, port.block, port.K0
    n, extra = loop.F.shape[0], a.size
    size = n + extra
    rest, offset = loop.rest()
    A, B = np.zeros((size, size)), np.zeros((size, 2))
    A[:n, :n], A[n:, n:] = loop.F, -np.diag(a)
    B[:n, 0], B[n:, 0], B[:n, 1] = -K0 * rest, -K0, port.microdamping * loop.B
    jumps = np.zeros((loop.jumps.shape[0], size, size))
    jumps[:, :n, :n] = loop.jumps
    jumps[:, n:, n:] = np.eye(extra)
    x, v, e = np.pad(loop.x, (0, extra)), np.pad(loop.v, (0, extra)), slice(n, size)
    Q = M[0, 0] * np.outer(v, v)
    Q[e, e] -= np.diag(nu * a / K0)
    N = np.column_stack([M[0, 2] * v - mu * K0 / 2 * x, M[0, 1] * v])
    N[e, 1] -= nu / 2
    stored = np.zeros((size + 1, size + 1))  # in (z, F)
    stored[e, e] = np.diag(nu) / (2 * K0)
    stored[:size, size] = stored[size, :size] = -mu / 2 * x
    stored[size, size] = mu / (2 * K0) - mu / 2 * float(loop.x @ rest)
    stored_error = np.zeros_like(stored)
    stored_error[size, size] = mu / 2 * float(np.abs(loop.x) @ offset)
    kept = size + (
        mu > 0
    )  # for mu = 0 no energy of F is stored: z decays exponentially, and F converges with it
    B_error = np.zeros_like(B)
    B_error[:n, 0] = K0 * offset
    return Dissipation(
        A=A,
        B=B,
        spans=loop.spans,
        jumps=jumps,
        Q=Q,
        N=N,
        R=np.array([[M[2, 2], M[1, 2]], [M[1, 2], M[1, 1]]]),
        stored=stored[:kept, :kept],
        B_error=B_error,
        stored_error=stored_error[:kept, :kept],
    )
