"""Controllers by H-infinity loop shaping (Glover & McFarlane)."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import require_positive, require_real
from robust._base.types import Controller, LinearSystem, Weight
from robust.lti.connections import block_diagonal, closed_loop, in_series
from robust.lti.lti import is_clockless, response, response_by_channel, timebase, with_names
from robust.lti.norms import hinf_norm, stabilising_riccati, to_continuous, to_discrete
from robust.lti.realisation import from_roots, multivariable
from robust.lti.stability import unstable_pole_values
from robust.models.sets.model import UncertaintyModel, plant_of
from robust.proofs.search.stability import certify_closed_loop
from robust.synthesis.hinf.design import Design
from robust.synthesis.hinf.generalised_plant import rank_margin

#: Rank margin of an unstable mode, below which an unstable loop is explained by it.
_NEARLY_CANCELLED = 1e-2


def ncfsyn(
    G: UncertaintyModel | Controller, W1: Weight = 1, W2: Weight = 1, *, factor: float = 1.1
) -> Design:
    """Design a controller by H-infinity loop shaping for the shaped plant W2 G W1.

    Use this if you can shape a loop but have no weights for S and T. The controller maximises
    robust stability against perturbations of the normalised coprime factors of W2 G W1.

    Shape the loop first: choose W1 (usually gain and integral action) so that |W2 G W1| is high
    where errors must be small and low where the plant is unknown. A gamma_min below about 4
    confirms that the controller can keep this shape.

    Parameters
    ----------
    G : control.StateSpace, TransferFunction, UncertaintyModel
        Plant with one or several inputs and outputs, continuous or discrete. For a sampled
        controller give the sampled plant (`robust.sampled`).
    W1, W2 : control.StateSpace, TransferFunction, float or (n_u, n_u), (n_y, n_y) ndarray
        Shaping functions at the input and output of the plant: each is a matrix (`control.append`),
        or one function that is used for every channel.
    factor : float
        Ratio of gamma of the controller to gamma_min, above 1. At gamma_min itself the loop may be
        unstable.

    Returns
    -------
    Design
        K = W1 K_inf W2. gamma is the norm of the loop of the shaped plant and K_inf; it is inf for
        an unstable loop. If gamma is not certified, `reason` states this.

    Raises
    ------
    ValueError
        Sampling times or shapes that differ, a shaped plant with an unstable mode that cannot be
        stabilised.

    References
    ----------
    McFarlane & Glover 1992; SP 9.4.1, eq. 9.62 to 9.67 (with positive feedback).

    Examples
    --------
    SP Example 9.3: gamma_min = 2.34.

    >>> G = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
    >>> design = ncfsyn(G, control.tf([1, 2], [1, 0]))
    >>> round(design.gamma_min, 3), bool(design.gamma <= 1.1 * design.gamma_min)
    (2.339, True)
    """
    factor = require_real("factor", factor)
    if factor <= 1:
        raise ValueError(f"factor must be above 1, got {factor:g}")
    G = plant_of("G", G)
    dt = timebase(G)
    W1 = _shaping_system("W1", W1, n=G.ninputs, dt=dt)
    W2 = _shaping_system("W2", W2, n=G.noutputs, dt=dt)
    shaped = in_series(W1, G, W2, dt=dt)
    matrices = (shaped.A, shaped.B, shaped.C, shaped.D)
    # the bilinear map keeps stability and norms: a sampled design is a continuous one
    if dt:
        A, B, C, D = to_continuous(*matrices)
    else:
        A, B, C, D = matrices
    # No iteration: both Riccati equations are independent of gamma, and gamma_min follows from them.
    X, Z = _riccati_solutions(A, B, C=C, D=D)
    gamma_min = float(np.sqrt(1 + max(np.linalg.eigvals(X @ Z).real, default=0.0)))
    gamma = factor * gamma_min  # L is singular at gamma_min itself
    L = (1 - gamma**2) * np.eye(len(A)) + X @ Z
    F = -np.linalg.solve(np.eye(D.shape[1]) + D.T @ D, D.T @ C + B.T @ X)
    Bk = gamma**2 * np.linalg.solve(L.T, Z @ C.T)
    Ak = A + B @ F + Bk @ (C + D @ F)
    central = (
        Ak,
        -Bk,
        B.T @ X,
        D.T,
    )  # the sign converts the book's positive feedback to negative feedback
    K_inf = control.StateSpace(*(to_discrete(*central) if dt else central), dt)
    K = with_names(
        in_series(W2, K_inf, W1, dt=dt), G.output_labels, G.input_labels
    )  # from the outputs of G to its inputs
    CL = control.StateSpace(*closed_loop(shaped, K_inf, ("u", "y"), ("p_out", "p_in")), dt)
    achieved = hinf_norm(CL)[0]
    if not np.isfinite(achieved):
        reason = _explain_unstable(shaped, gamma_min)
        return Design(K=K, gamma=achieved, gamma_min=gamma_min, met=False, reason=reason, CL=CL)
    proof = certify_closed_loop(
        _coprime_factor_plant(shaped), K_inf, achieved, subject="norm of the shaped loop"
    )
    if proof.holds:
        reason = ""
    else:
        reason = f"gamma is not certified: {proof.reason}"
    return Design(
        K=K, gamma=proof.level, gamma_min=gamma_min, reason=reason, certificate=proof, CL=CL
    )


def _explain_unstable(shaped: control.StateSpace, gamma_min: float) -> str:
    """Return the reason why K does not stabilise a shaped plant, with the mode hardest to reach or
    to observe.
    """
    modes = unstable_pole_values(shaped, timebase(shaped))
    away = [shaped.A - mode * np.eye(shaped.nstates) for mode in modes]
    reached = [
        min(rank_margin(np.hstack([one, shaped.B])), rank_margin(np.vstack([one, shaped.C])))
        for one in away
    ]
    text = (
        f"K does not stabilise the shaped plant: gamma_min is {gamma_min:.3g}, too large for"
        " floating point"
    )
    if not reached or min(reached) > _NEARLY_CANCELLED:
        return text
    variable = "z" if timebase(shaped) else "s"
    mode = np.real_if_close(modes[int(np.argmin(reached))])
    return (
        f"{text}. Its mode at {variable} = {mode:.4g} nearly cancels with a zero:"
        f" {min(reached):.1g} of it remains"
    )


def _coprime_factor_plant(G: control.StateSpace) -> control.StateSpace:
    """Return the system from (p_out, p_in, u) to (u, y) and the error -y for the controller."""
    n_u, n_y, n = G.ninputs, G.noutputs, G.nstates
    one, none = np.eye(n_u), np.zeros
    B = np.hstack([none((n, n_y)), G.B, G.B])
    C_y = np.hstack([np.eye(n_y), G.D, G.D])
    C = np.vstack([none((n_u, n)), G.C, -G.C])
    D = np.vstack([np.hstack([none((n_u, n_y + n_u)), one]), C_y, -C_y])
    return control.StateSpace(G.A, B, C, D, G.dt)


def _riccati_solutions(
    A: np.ndarray, B: np.ndarray, *, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return X and Z of the shaped plant: those of control and of filtering."""
    X, Z = (
        stabilising_riccati(a, b, Q=c.T @ c, R=np.eye(d.shape[1]) + d.T @ d, S=c.T @ d)
        for a, b, c, d in ((A, B, C, D), (A.T, C.T, B.T, D.T))
    )
    if X is None or Z is None:
        raise ValueError(
            "W2 G W1 must be stabilisable and detectable, got a plant whose Riccati equations"
            " have no solution. Does W1 or W2 cancel an unstable or undamped mode?"
        )
    return X, Z


def _shaping_system(name: str, given: Weight, *, n: int, dt: float) -> control.StateSpace:
    """Return a shaping function for n channels of the plant, at its input (W1) or its output
    (W2).
    """
    W = multivariable(name, given)
    if (W.ninputs, W.noutputs) == (1, 1) and n > 1:
        W = block_diagonal([W] * n, W.dt)
    if name == "W1":
        n_channels, side = W.noutputs, "outputs"
    else:
        n_channels, side = W.ninputs, "inputs"
    if n_channels != n:
        raise ValueError(
            f"{name} must have {n} {side}, one a channel of G, or be a single one for all, got"
            f" {n_channels}"
        )
    if not is_clockless(W) and timebase(W) != dt:
        raise ValueError(
            f"{name} must have the sampling time of G, {dt:g} s, got {timebase(W):g} s"
        )
    return W


def crossover_weight(G: LinearSystem, omega_c: float) -> control.StateSpace:
    """Return a first weight W1 for `ncfsyn`, with integral action and a given crossover.

    For several channels W1 is diagonal, and each entry is computed from the diagonal entry of the
    plant.

    If |G| is constant around omega_c, W1 = k / s, so that |G W1| falls by 20 dB per decade at the
    crossover. If |G| already falls around omega_c, W1 = k (s + omega_c/5) / s.

    Parameters
    ----------
    G : control.StateSpace, TransferFunction or UncertaintyModel
        Plant, continuous or discrete.
    omega_c : float
        Requested crossover |G W1| = 1 [rad/s].

    Returns
    -------
    control.StateSpace
        W1 with the sampling time of G; for a discrete G by the bilinear map.

    Raises
    ------
    ValueError
        A crossover above the Nyquist frequency, or at a frequency where G is zero.

    References
    ----------
    SP 9.4.2 (choice of the shaping functions); the integrator of this weight is the usual first
    choice.

    Examples
    --------
    >>> W1 = crossover_weight(control.tf([2], [1, 10]), 1.0)
    >>> round(float(abs(W1(1j) * 2 / (1j + 10))), 12)
    1.0
    """
    G = plant_of("G", G)
    omega_c, dt = require_positive("omega_c", omega_c), timebase(G)
    if G.ninputs != G.noutputs:
        raise ValueError(
            f"G must have as many inputs as outputs, got {G.ninputs} inputs and {G.noutputs}"
            " outputs"
        )
    if dt and omega_c * dt > np.pi / 2:
        raise ValueError(
            f"omega_c must be at most half the Nyquist frequency, {np.pi / dt / 2:g} rad/s"
            f" ({0.25 / dt:g} Hz), got {omega_c:g} rad/s ({omega_c / (2 * np.pi):g} Hz)"
        )
    gains = np.abs(response_by_channel(G, omega_c * np.array([0.9, 1.0, 1.1])))
    loops = [_crossover_of_loop(gains[k, k], omega_c, dt) for k in range(G.ninputs)]
    if len(loops) == 1:
        return loops[0]
    return block_diagonal(loops, dt)


def _crossover_of_loop(gains: np.ndarray, omega_c: float, dt: float) -> control.StateSpace:
    """Return `crossover_weight` for one loop, from |G| (3,) at 0.9, 1 and 1.1 omega_c."""
    if not np.all((gains > 0) & np.isfinite(gains)):
        raise ValueError(
            f"omega_c must be a frequency at which |G| is positive, got |G| = {gains[1]:g} at"
            f" {omega_c:g} rad/s ({omega_c / (2 * np.pi):g} Hz)"
        )
    flat = np.log(gains[2] / gains[0]) / np.log(1.1 / 0.9) > -0.5
    if flat:
        zeros = np.zeros(0)
    else:
        zeros = np.array([-omega_c / 5])
    W = from_roots(zeros, np.zeros(1), 1.0, 0.0)
    if dt:
        # the bilinear map is scaled to be exact at omega_c
        scale = omega_c / np.tan(omega_c * dt / 2)
        W = control.StateSpace(*to_discrete(W.A / scale, W.B / scale, W.C, W.D), dt)
    gain = 1 / (gains[1] * np.abs(response(W, np.array([omega_c])))[0])
    return control.StateSpace(W.A, W.B, W.C * gain, W.D * gain, W.dt)
