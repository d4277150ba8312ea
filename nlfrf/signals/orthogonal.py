"""Multisines for several inputs at once: orthogonal sets of experiments, or one experiment whose lines are shared out.

    U_ie(k) = A_i(k) exp(j phi_i(k)) T_ie exp(j psi_e(k)),    T T^H = n_u I,  |T_ie| = 1

With phi and psi random over lines, inputs, experiments and sets every experiment has independent phases in every
channel, so that what holds for one random-phase multisine (the BLA, the grids, detection lines) holds for each of
them, while U U^H = n_u diag(A_i^2) exactly (Dobrowiecki & Schoukens 2007). Zippered: each line drives one input only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import HOLDS, require_choice, require_integer, require_positive, require_real_array
from nlfrf._base.values import ArrayField, value
from nlfrf.signals.lines import LineGrid

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

DESIGNS = ("orthogonal", "zippered")


@value
class OrthogonalMultisine:
    """One period of every experiment for a plant of several inputs.

    Fields
    ------
    fs : float
        Sampling frequency [Hz].
    n_samples : int
        Samples N in one period.
    kind : str
        The kind of harmonic grid.
    lines : LineGrid
        Excited and detection lines, the same for all inputs.
    design : str
        "orthogonal": n_inputs experiments make a set. "zippered": each line drives one input, one experiment is
        enough.
    amplitude : (n_u, F) ndarray
        Amplitude of the cosine on each line, before mixing; zero where a zippered line drives another input.
    phase : (n_u, M, F) ndarray
        Phases [rad] of each input in each experiment, before mixing.
    mixing : (n_u, n_u) ndarray, optional
        u = mixing @ (the orthogonal signals): one row for each input of the plant. None: the identity.
    hold : str
        How all inputs will run between their samples, see `multisine`.

    References
    ----------
    T. Dobrowiecki, J. Schoukens, *Measuring a linear approximation to weakly nonlinear MIMO systems*, Automatica 43,
    2007; Pintelon & Schoukens, 2nd ed., 2.7 and 3.7.

    Examples
    --------
    Two inputs: each experiment excites both, the set tells them apart.

    >>> from nlfrf import multisine
    >>> ms = multisine(fs=128, n_samples=128, f_min=1, f_max=40, rms=(1.0, 2.0), n_inputs=2, rng=1)
    >>> ms.u.shape, ms.rms.round(12).tolist()
    ((2, 2, 128), [1.0, 2.0])
    """

    fs: float
    n_samples: int
    kind: str
    lines: LineGrid
    design: str
    amplitude: np.ndarray
    phase: np.ndarray
    mixing: ArrayField = None
    hold: str = "unknown"

    def __post_init__(self) -> None:
        require_choice("hold", self.hold, HOLDS)
        require_positive("fs", self.fs)
        require_integer("n_samples", self.n_samples, least=4)
        require_choice("design", self.design, DESIGNS)
        n_lines, highest = self.lines.excited.size, int(self.lines.excited[-1])
        if 2 * highest >= self.n_samples:
            raise ValueError(f"lines must lie below the Nyquist line {self.n_samples / 2:g}, got line {highest}")
        amplitude, phase = (
            require_real_array("amplitude", self.amplitude, ndim=2),
            require_real_array("phase", self.phase, ndim=3),
        )
        if amplitude.shape[1] != n_lines or phase.shape[0] != len(amplitude) or phase.shape[2] != n_lines:
            raise ValueError(
                f"amplitude and phase must have shapes (n_u, {n_lines}) and (n_u, M, {n_lines}), "
                f"got {amplitude.shape} and {phase.shape}"
            )
        if np.any(amplitude < 0) or not amplitude.any(axis=1).all():
            raise ValueError("amplitude must be zero or positive, with some line for every input")
        if self.mixing is not None:
            check_mixing(require_real_array("mixing", self.mixing, ndim=2), len(amplitude))

    @property
    def n_inputs(self) -> int:
        """Inputs n_u."""
        return self.phase.shape[0]

    @property
    def n_experiments(self) -> int:
        """Experiments M: n_u times as many as sets where the design is orthogonal."""
        return self.phase.shape[1]

    @property
    def n_realizations(self) -> int:
        """Sets R of experiments, each of which gives the whole matrix."""
        return self.n_experiments // (self.n_inputs if self.design == "orthogonal" else 1)

    @property
    def f0(self) -> float:
        """Frequency resolution fs / N [Hz]."""
        return self.fs / self.n_samples

    @property
    def f(self) -> np.ndarray:
        """(F,) excited frequencies [Hz]."""
        return self.lines.excited * self.f0

    @property
    def rms(self) -> np.ndarray:
        """(n_u,) root mean square of each input, over the experiments of a set."""
        power = np.sum(self.amplitude**2, axis=1) / 2
        return np.sqrt(power if self.mixing is None else self.mixing**2 @ power)

    @property
    def u(self) -> np.ndarray:
        """(n_u, M, N) one period of each input in each experiment."""
        return self.sampled(self.n_samples)

    @property
    def crest_factor(self) -> np.ndarray:
        """(n_u, M) peak over rms of each input in each experiment, on the samples."""
        return np.abs(self.u).max(axis=2) / self.rms[:, None]

    @property
    def spectrum(self) -> np.ndarray:
        """(n_u, M, F) complex amplitudes of the inputs, mixing included."""
        logical = self.amplitude[:, None] * np.exp(1j * self.phase)
        return logical if self.mixing is None else np.tensordot(self.mixing, logical, 1)

    def sampled(self, n_samples: int) -> np.ndarray:
        """Return (n_u, M, n_samples) the same period sampled more densely: the band-limited signal itself."""
        spectrum = np.zeros((self.n_inputs, self.n_experiments, n_samples // 2 + 1), dtype=complex)
        spectrum[..., self.lines.excited] = self.spectrum * (n_samples / 2)
        return np.fft.irfft(spectrum, n_samples, axis=2)


def orthogonal_multisine(
    fs: float,
    n_samples: int,
    *,
    kind: str,
    grid: LineGrid,
    amplitude: np.ndarray,
    rms: np.ndarray,
    n_realizations: int,
    design: str,
    mixing: ArrayLike | None,
    n_draws: int,
    hold: str,
    rng: np.random.Generator,
) -> OrthogonalMultisine:
    """The signals of `multisine(n_inputs=...)`: relative amplitudes (n_u, F) scaled to rms (n_u,), phases drawn."""
    require_choice("design", design, DESIGNS)
    n_inputs = len(amplitude)
    if design == "zippered":
        if mixing is not None:
            raise ValueError(f"mixing must be left out for a zippered design: a line drives one input, got {mixing}")
        amplitude = amplitude * assign_lines(kind, grid, n_inputs=n_inputs, rng=rng)
        T = None
    else:
        T = np.angle(dft_matrix(n_inputs))
    if mixing is not None:
        mixing = require_real_array("mixing", mixing, ndim=2)
        check_mixing(mixing, n_inputs)
    amplitude = amplitude * (rms / np.sqrt(np.sum(amplitude**2, axis=1) / 2))[:, None]

    def drawn() -> OrthogonalMultisine:
        """One draw of all phases."""
        phases = [set_phases(n_inputs, grid.excited.size, T=T, rng=rng) for _ in range(n_realizations)]
        return OrthogonalMultisine(
            fs=fs,
            n_samples=n_samples,
            kind=kind,
            lines=grid,
            design=design,
            amplitude=amplitude,
            phase=np.concatenate(phases, axis=1),
            mixing=mixing,
            hold=hold,
        )

    if n_draws == 1:
        return drawn()
    return min((drawn() for _ in range(n_draws)), key=lambda ms: float(ms.crest_factor.max()))


def set_phases(n_inputs: int, n_lines: int, *, T: np.ndarray | None, rng: np.random.Generator) -> np.ndarray:
    """Return (n_u, n_u or 1, F) phases of one set: phi_i + psi_e + arg T_ie, all of them from 0 to 2 pi."""
    phi = rng.uniform(0, 2 * np.pi, size=(n_inputs, 1, n_lines))
    if T is None:
        return phi
    psi = rng.uniform(0, 2 * np.pi, size=(1, n_inputs, n_lines))
    return np.mod(phi + psi + T[:, :, None], 2 * np.pi)


def assign_lines(kind: str, grid: LineGrid, *, n_inputs: int, rng: np.random.Generator) -> np.ndarray:
    """(n_u, F) one where a zippered line drives the input: every input once in every n_u excited lines, at random.

    On a grid that repeats, what u1^3 sends to the detection lines would never be what it sends to its own lines.
    """
    if kind in ("special-odd", "odd-odd"):
        raise ValueError(
            f'kind must be "random-odd" for a zippered design, got {kind!r}: its detection lines would cover '
            "61 to 78 % where 95 % is said"
        )
    n_lines = grid.excited.size
    if n_lines < 2 * n_inputs:
        raise ValueError(f"f_min and f_max must hold at least two lines an input, {2 * n_inputs}, got {n_lines}")
    rounds = -(-n_lines // n_inputs)
    owner = np.concatenate([rng.permutation(n_inputs) for _ in range(rounds)])[:n_lines]
    return (owner == np.arange(n_inputs)[:, None]).astype(float)


def dft_matrix(n: int) -> np.ndarray:
    """Return (n, n) T with T T^H = n I and |T_ie| = 1, which separates the experiments of a set."""
    return np.exp(-2j * np.pi * np.outer(np.arange(n), np.arange(n)) / n)


def check_mixing(mixing: np.ndarray, n_inputs: int) -> None:
    """Refuse a mixing that leaves some direction without input."""
    if mixing.shape != (n_inputs, n_inputs):
        raise ValueError(f"mixing must have shape ({n_inputs}, {n_inputs}), got {mixing.shape}")
    sizes = np.linalg.svd(mixing, compute_uv=False)
    if not sizes[-1] > 1e-9 * sizes[0]:
        raise ValueError(f"mixing must have full rank, got singular values from {sizes[-1]:.3g} to {sizes[0]:.3g}")
