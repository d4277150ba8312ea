"""The nominal model of a measured matrix: what is asked for, checked, fitted, and what the fit leaves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf import Frm
from nlfrf.shared.arguments import integer, nonnegative, of_kind, real_array
from nlfrf.shared.values import value
from nlfrf.shared.wording import shown
from robust.modelling.shared_poles import SharedPoles, fit_shared_poles, improve, rough_fit, tangents, whitening
from robust.systems.sampling import delay_samples, discretize

__all__ = ["MAX_POLES", "as_matrices", "fit_matrix", "refuse_other_channels"]


MAX_POLES = 40
MOST_TRIALS, N_ROUNDS = 41, 12
SETTLED = 1e-7  # of a turn at the highest line: a delay that moves less stands


@value(copy=False)
class Sought:
    """What is fitted: where, to what, in which metric, of which kind.

    Fields
    ------
    points, omega : (F,) ndarray
        Of the fit and of the record [rad/s].
    G : (F, n_y, n_u) complex ndarray
        The matrix.
    left, right : (F, n_y, n_y), (F, n_u, n_u) complex ndarray
        What whitens its error.
    kind : dict
        n_poles, rank, direct and stable.
    """

    points: np.ndarray
    omega: np.ndarray
    G: np.ndarray
    left: np.ndarray
    right: np.ndarray
    kind: dict[str, Any]

    def behind(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Arguments of a fit of what is left when the delays (n_u,) of the inputs are taken off."""
        turn = np.exp(1j * self.omega[:, None] * tau)
        return self.points, self.G * turn[:, None], self.left, turn.conj()[:, :, None] * self.right

    def fitted(self, tau: np.ndarray, start: SharedPoles | None = None) -> tuple[SharedPoles, float]:
        """The best model behind given delays, from a start or from scratch, with its cost."""
        points, G, left, right = self.behind(tau)
        model = start or fit_shared_poles(points, G, left, right, **self.kind)
        return improve(points, G, left, right, model, self.kind["direct"], self.kind["stable"])


def as_matrices(bla: Any) -> list[Frm]:
    """The matrices that were given, one or at several levels, of the same inputs and outputs; none of anything else."""
    many = list(bla) if isinstance(bla, list | tuple) else [bla]
    if not any(isinstance(one, Frm) for one in many):
        return []
    for one in many:
        of_kind("bla", one, Frm)
        for name in ("inputs", "outputs"):
            if getattr(one, name) != getattr(many[0], name):
                raise ValueError(
                    f"bla must be matrices of the same {name}, got {', '.join(getattr(many[0], name))} and "
                    f"{', '.join(getattr(one, name))}"
                )
    return many


def refuse_other_channels(frm: Frm, known: Any, of: str) -> None:
    """Refuse a record whose channels are called otherwise, or stand in another order; unnamed ones go with any."""
    for name, letter in (("inputs", "u"), ("outputs", "y")):
        first, second = tuple(getattr(known, name)), tuple(getattr(frm, name))
        unnamed = (), tuple(f"{letter}{i + 1}" for i in range(len(second)))
        if first != second and first not in unnamed and second not in unnamed:
            raise ValueError(
                f"bla must be a matrix of the same {name} as {of}, {', '.join(first)}, got {', '.join(second)}"
            )


def fit_matrix(
    frms: list[Frm], n_poles: int, n_zeros: int | None, delay: Any, dt: float, stable: bool, rank: int
) -> dict[str, Any]:
    """The fields of the `NominalFit` of a matrix, measured once or at several levels: one model for all."""
    frm, omega = frms[0], np.concatenate([one.omega for one in frms])
    n_poles, rank = integer("n_poles", n_poles, least=0), integer("rank", rank, least=1)
    estimated = isinstance(delay, str)
    tau = np.zeros(frm.n_inputs) if estimated else given_delays(delay, frm.n_inputs, dt)
    if estimated and delay != "estimate":
        raise ValueError(f'delay must be a number [s], one for each input, or "estimate", got {shown(delay)}')
    if n_poles > MAX_POLES:
        raise ValueError(f"n_poles must be at most {MAX_POLES}, got {n_poles}")
    if n_zeros not in (None, n_poles):
        raise ValueError(f"n_zeros must be None or n_poles = {n_poles} for an Frm, got {n_zeros}")
    if dt and omega.max() * dt >= np.pi:
        raise ValueError(
            f"dt must put the Nyquist frequency above the last line, {omega.max() / 2 / np.pi:g} Hz, got dt = {dt:g} s "
            f"with Nyquist {0.5 / dt:g} Hz"
        )
    measured = np.concatenate([one.G for one in frms], axis=2)
    left, right = (np.concatenate(roots) for roots in zip(*map(whitening, frms), strict=True))
    sought = Sought(
        # j omega, or its bilinear image: both kinds of model are fitted in the s plane
        points=2 / dt * np.tan(omega * dt / 2) if dt else omega,
        omega=omega,
        G=np.moveaxis(measured, 2, 0),
        left=left,
        right=right,
        kind={"n_poles": n_poles, "rank": rank, "direct": n_zeros is not None or dt > 0, "stable": stable},
    )
    model, tau = estimated_delays(sought, dt) if estimated else (sought.fitted(tau)[0], tau)
    n_parameters = model.n_parameters + (frm.n_inputs if estimated and not dt else 0)
    if 2 * measured.size < n_parameters:
        raise ValueError(f"n_poles must leave at most {2 * measured.size} parameters, got {n_parameters}")
    response = np.moveaxis(model.response(sought.points), 0, 2) * np.exp(-1j * omega * tau[:, None])
    residual = measured - response
    weighted = left @ np.moveaxis(residual, 2, 0) @ right
    L = np.minimum(np.concatenate([one.dof for one in frms]), 1e12)
    expected = frm.n_outputs * frm.n_inputs * np.sum(L / np.maximum(L - frm.n_outputs, np.finfo(float).tiny))
    G = model.state_space()
    return dict(
        G=discretize(G, dt) if dt else G,
        delay=float(tau.min()),
        delays=tau,
        omega=omega,
        response=response,
        residual=residual,
        std=np.concatenate([np.sqrt(one.entries(one.cov_bound)) for one in frms], axis=2),
        cost=float(np.sum(np.abs(weighted) ** 2)),
        expected_cost=float(expected * (1 - n_parameters / (2 * measured.size))),
        n_parameters=n_parameters,
        hold=frm.hold if len({one.hold for one in frms}) == 1 else "unknown",
        inputs=frm.inputs,
        outputs=frm.outputs,
    )


def given_delays(delay: Any, n_inputs: int, dt: float) -> np.ndarray:
    """(n_u,) delays [s] from one number for all inputs or one for each; in discrete time whole samples."""
    if np.ndim(delay) == 0:
        tau = np.full(n_inputs, nonnegative("delay", delay))
    else:
        tau = real_array("delay", delay, ndim=1)
        if tau.size != n_inputs or np.any(tau < 0):
            raise ValueError(f"delay must be one number or {n_inputs}, one for each input, none negative, got {tau}")
    return np.array([delay_samples("delay", float(one), dt) * dt for one in tau]) if dt else tau


def estimated_delays(sought: Sought, dt: float) -> tuple[SharedPoles, np.ndarray]:
    """The model and the delays of the inputs that explain the phases best.

    Each input's column is scanned by itself, then all are refined with the model: a Gauss-Newton step of delays and
    model together moves the delays, the model follows. In discrete time the samples on both sides are tried in turn.
    """
    omega, n_u = sought.omega, sought.G.shape[2]
    tau = np.array([scanned(sought, i) for i in range(n_u)])
    model, cost = sought.fitted(tau)
    for _ in range(N_ROUNDS):
        step = joint_step(sought, model, tau)
        for _ in range(6):
            moved = np.maximum(tau + step, 0.0)
            there, lower = sought.fitted(moved, model)
            if lower < cost:
                break
            step = step / 4
        if not lower < cost:
            break
        done = np.abs(moved - tau).max() * omega.max() < 2 * np.pi * SETTLED
        model, cost, tau = there, lower, moved
        if done:
            break
    if not dt:
        return model, tau
    samples = np.round(tau / dt)
    model, cost = sought.fitted(samples * dt, model)
    for i in range(n_u):
        for move in (-1, 1):
            other = samples.copy()
            other[i] = max(other[i] + move, 0)
            there, lower = sought.fitted(other * dt, model)
            if lower < cost:
                model, cost, samples = there, lower, other
    return model, samples * dt


def scanned(sought: Sought, i: int) -> float:
    """The delay of one input by rough fits of its column, up to twice what its phase falls by, an eighth turn apart."""
    G, omega = sought.G[:, :, i : i + 1], sought.omega
    rises = np.flatnonzero(np.diff(omega) > 0)  # several levels stand one behind the other
    falls = -np.angle(np.sum(G[rises + 1] * G[rises].conj(), axis=(1, 2))) / np.diff(omega)[rises]
    size = np.sum(np.abs(G[rises + 1] * G[rises]), axis=(1, 2))
    longest = max(2 * float(np.sum(falls * size) / np.sum(size)), 2 * np.pi / omega.max())
    one = replace(sought, G=G, right=np.ones((omega.size, 1, 1)))
    n = min(int(np.ceil(longest * omega.max() / (2 * np.pi) * 8)) + 1, MOST_TRIALS)

    def cost(tau: float) -> float:
        """What vector fitting alone leaves."""
        points, G, left, right = one.behind(np.array([tau]))
        residual = left @ (G - rough_fit(points, G, left, right, **sought.kind).response(points))
        return float(np.sum(np.abs(residual) ** 2))

    return float(min(np.linspace(0.0, longest, n), key=cost))


def joint_step(sought: Sought, model: SharedPoles, tau: np.ndarray) -> np.ndarray:
    """(n_u,) by which the delays move in a Gauss-Newton step of delays and model together."""
    points, G, left, right = sought.behind(tau)
    turned = 1j * sought.omega[:, None, None] * G  # of each column by its own delay
    by_delay = np.array([np.where(np.arange(tau.size) == i, turned, 0.0) for i in range(tau.size)])
    by_model = tangents(points, model, sought.kind["direct"], sought.kind["stable"])

    def whitened(X: np.ndarray) -> np.ndarray:
        """Errors (..., F, n_y, n_u) in units of their standard deviation, real over imaginary."""
        flat = (left @ X @ right).reshape(*X.shape[:-3], -1)
        return np.concatenate([flat.real, flat.imag], axis=-1)

    J = whitened(np.concatenate([-by_delay, by_model])).T
    scale = np.maximum(np.linalg.norm(J, axis=0), np.finfo(float).tiny)
    step = np.linalg.lstsq(J / scale, whitened(G - model.response(points)), rcond=1e-12)[0] / scale
    return np.asarray(step[: tau.size])
