"""The loop around a plant known on its lines, and its limits: peaks of each over the lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import control
import numpy as np

from nlfrf._base.values import value
from robust.lti.connections import lower_lft
from robust.lti.lti import evaluate_transfer, frequency_response_matrices
from robust.lti.norms import continuous_matrices, discrete_matrices
from robust.lti.stability import count_half_turns, integrator_poles, unstable_poles, winding_number
from robust.synthesis.tuning.limits import Channel
from robust.synthesis.tuning.loops import (
    CloseLook,
    Peak,
    bilinear_frequency,
    highest_places,
    peaks_of_gains,
)
from robust.synthesis.tuning.plants import MeasuredPlant
from robust.synthesis.tuning.worst import Scalings


class MeasuredLoop:
    """The loop of a plant that is known on lines: nothing is computed between them."""

    def __init__(
        self,
        index: int,
        fixed: control.StateSpace,
        plant: MeasuredPlant,
        channels: Sequence[Channel],
        *,
        dt: float,
        n_external: int,
        n_looked_at: int,
        sizes: tuple[int, int, int],
    ) -> None:
        """fixed: from (inputs, plant outputs, block outputs) to (outputs of limits, plant inputs,
        block inputs).
        """
        self.index, self.plant, self.channels, self.dt = index, plant, channels, dt
        self.n_states, self.n_in, self.n_out = sizes
        n_y, n_u = plant.G.shape[:2]
        self.image = bilinear_frequency(plant.omega, dt)
        matrices = continuous_matrices(fixed, dt)
        self.around = matrices, n_external, n_looked_at
        P = evaluate_transfer(*matrices, 1j * self.image)
        # close the plant: u' = u_p + du, y_p = G u' + dy; then (w, du, dy, u) -> (z, u', y)
        G = np.moveaxis(plant.G, 2, 0)
        y_p, u_p = np.s_[n_external : n_external + n_y], np.s_[n_looked_at : n_looked_at + n_u]
        du = np.zeros((len(P), P.shape[1], n_u))
        du[:, u_p] = np.eye(n_u)
        inner = np.linalg.inv(np.eye(n_u) - P[:, u_p, y_p] @ G)
        around = np.concatenate([P[:, :, :n_external], du, P[:, :, n_external:]], axis=2)
        full = around + P[:, :, y_p] @ G @ inner @ around[:, u_p]
        n_w, n_z = n_external + n_u + n_y, n_looked_at + n_u
        self.P11, self.P12 = full[:, :n_z, :n_w], full[:, :n_z, n_w:]
        self.P21, self.P22 = full[:, n_z:, :n_w], full[:, n_z:, n_w:]
        self.scalings: dict[int, Scalings] = {}

    def blocks_at(self, M: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return K, [C Phi, I] and [Phi B; I] of the blocks on the lines."""
        n = self.n_states
        A, B, C, D = M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]
        W = len(self.image)
        if n:
            Phi = np.linalg.inv(1j * self.image[:, None, None] * np.eye(n) - A)
        else:
            Phi = np.zeros((W, 0, 0), complex)
        left = np.concatenate(
            [C @ Phi, np.broadcast_to(np.eye(self.n_out), (W, self.n_out, self.n_out))], axis=2
        )
        right = np.concatenate(
            [Phi @ B, np.broadcast_to(np.eye(self.n_in), (W, self.n_in, self.n_in))], axis=1
        )
        return D + C @ Phi @ B, left, right

    def responses(self, M: np.ndarray) -> np.ndarray | None:
        """Return (W, outputs, inputs) on the lines; None if the loop has no solution on one."""
        K, _, _ = self.blocks_at(M)
        try:
            return self.P11 + self.P12 @ K @ np.linalg.solve(
                np.eye(self.n_in) - self.P22 @ K, self.P21
            )
        except np.linalg.LinAlgError:
            return None

    def band(self, channel: Channel) -> np.ndarray:
        """Return a mask of the lines in the band of a limit."""
        omega = self.plant.omega
        low, high = channel.limit.band or (0.0, np.inf)
        return (omega >= low) & (omega <= high)

    def levels(self, channel: Channel, H: np.ndarray, *, exact: bool = False) -> np.ndarray:
        """Return (W,) gain times weight over bound on the lines; zero outside the band."""
        perturbation = self.plant.perturbation
        if exact:
            gain = channel.exact_gain(H, perturbation)
        else:
            gain = channel.gain(H, perturbation, self.scalings_on_lines(channel))
        return np.where(self.band(channel), gain * channel.limit.factor(self.plant.omega), 0.0)

    def scalings_on_lines(self, channel: Channel) -> np.ndarray | None:
        """Return the scalings (W, K) of the search; None if the limit has none."""
        if channel.is_scaled:
            return np.exp(self.scalings[channel.index].log_d.T)
        return None

    def close(self, M: np.ndarray) -> _ClosedLines | None:
        """Return the loop with the blocks M; None if it has no solution, or the lines do not show
        that it is stable.
        """
        if all(self.stability_by_winding(M)):
            H = self.responses(M)
        else:
            H = None
        if H is None:
            return None
        return _ClosedLines(M=M, H=H)

    def refit_scalings(self, loop: _ClosedLines) -> None:
        """Fit the scalings of the worst cases to a loop again."""
        for channel in self.channels:
            if channel.is_scaled:
                assert self.plant.perturbation is not None
                level = 1 / np.maximum(channel.limit.factor(self.plant.omega), 1e-300)
                found = channel.best_scalings(
                    self.plant.omega, loop.H, self.plant.perturbation, level
                )
                self.scalings[channel.index] = found

    def peaks(self, loop: _ClosedLines, slopes: np.ndarray) -> list[Peak]:
        """Return peaks on the lines with their gradients."""
        K, left, right = self.blocks_at(loop.M)
        if any(
            channel.is_scaled and channel.index not in self.scalings for channel in self.channels
        ):
            self.refit_scalings(loop)
        found = []
        for channel in self.channels:
            level = self.levels(channel, loop.H)
            for k in highest_places(level):
                if level[k] <= 0:
                    continue
                inner = np.linalg.inv(np.eye(self.n_in) - self.P22[k] @ K[k])
                L = self.P12[k] @ (np.eye(self.n_out) + K[k] @ inner @ self.P22[k]) @ left[k]
                R = right[k] @ inner @ self.P21[k]
                perturbation, d = self.plant.perturbation, self.scalings_on_lines(channel)
                factor = float(channel.limit.factor(self.plant.omega[[k]])[0])
                slope = channel.slopes(
                    loop.H[k],
                    None if perturbation is None else perturbation.at(k),
                    None if d is None else d[k],
                )
                found += peaks_of_gains(
                    channel,
                    self.index,
                    omega=float(self.image[k]),
                    factor=factor,
                    found=slope,
                    sides=(L, R),
                    slopes=slopes,
                )
        return found

    def raise_norms(self, loop: _ClosedLines) -> dict[int, tuple[float, float, bool]]:
        """Return the largest level of each limit on the lines, and its frequency in the plane of
        the bilinear map.
        """
        found = {}
        for channel in self.channels:
            level = self.levels(channel, loop.H, exact=True)
            k = int(np.argmax(level))
            found[channel.index] = (float(level[k]), float(self.image[k]), False)
        return found

    def curve(self, channel: Channel, loop: _ClosedLines, omega: np.ndarray) -> np.ndarray:
        """Return (W,) ratio of a limit on its lines omega."""
        return self.levels(channel, loop.H, exact=True)[self.band(channel)]

    def frequencies(self, channel: Channel, loop: _ClosedLines) -> np.ndarray:
        """Return lines of a limit, in the plane of the bilinear map [rad/s]."""
        return self.image[self.band(channel)]

    def look_closely(self, loop: _ClosedLines) -> dict[int, CloseLook]:
        """Return every limit on the lines of its band."""
        return {
            channel.index: CloseLook(
                ratio=level,
                omega=omega,
                n_lines=int((self.band(channel) & self.plant.on_lines).sum()),
            )
            for channel, (level, omega, _) in zip(
                self.channels, self.raise_norms(loop).values(), strict=True
            )
        }

    def seen_by_plant(self, M: np.ndarray) -> control.StateSpace | None:
        """Return the controller of fixed parts and blocks from plant outputs to inputs; None: no
        solution.
        """
        (A, B, C, D), n_w, n_z = self.around
        n = self.n_states
        fixed = control.StateSpace(
            A, B[:, n_w:], C[n_z:], D[n_z:, n_w:], remove_useless_states=False
        )
        blocks = control.StateSpace(
            M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:], remove_useless_states=False
        )
        try:
            K = lower_lft(fixed, blocks)
            matrices = discrete_matrices((K.A, K.B, K.C, K.D), self.dt)
        except (ValueError, np.linalg.LinAlgError):
            return None
        return control.StateSpace(*matrices, self.dt, remove_useless_states=False)

    def stability_by_winding(self, M: np.ndarray) -> tuple[bool, bool]:
        """Return True if the loop is stable by its winding number, and True if the lines resolve
        that.
        """
        K = self.seen_by_plant(M)
        if K is None:
            return False, False
        on, readings = self.plant.on_lines, self.plant.readings
        G, omega = self.plant.G[:, :, on], self.plant.omega[on]
        wanted = self.plant.n_unstable + unstable_poles(K, self.dt)
        if G.shape[:2] == (1, 1):
            turns, clear = winding_number(omega, G[0, 0], K=-K, dt=self.dt, readings=readings)
            return turns == wanted, clear
        of_blocks = frequency_response_matrices((K.A, K.B, K.C, K.D), omega, self.dt)
        F = np.linalg.det(np.eye(K.noutputs) - of_blocks @ np.moveaxis(G, 2, 0))
        n = integrator_poles(K, self.dt) + (readings[0].n_integrators if readings else 0)
        found, clear_all = count_half_turns(F, n)
        return round(float(found)) == wanted, bool(clear_all)


@value(copy=False)
class _ClosedLines:
    """A stable loop around an FRF: the matrix M of its blocks, and H (W, outputs, inputs) on the
    lines.
    """

    M: np.ndarray
    H: np.ndarray
    poles: ClassVar[np.ndarray] = np.zeros(0, complex)
