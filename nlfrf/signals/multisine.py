"""Design of random-phase multisines: u(t) = sum_k A_k cos(2 pi k f0 t + phi_k)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeAlias, cast

import numpy as np

from nlfrf._base.arguments import (
    HOLDS,
    format_count,
    random_generator,
    require_choice,
    require_integer,
    require_kind,
    require_positive,
    require_real_array,
    short_form,
)
from nlfrf._base.values import ArrayField, value
from nlfrf.signals.lines import KINDS, LineGrid, describe_band, grid_lines
from nlfrf.signals.orthogonal import DESIGNS, assign_lines, check_mixing, draw_phases

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: Relative amplitudes on the excited lines, or a function of their frequencies [Hz].
Amplitude: TypeAlias = "np.ndarray | Callable[[np.ndarray], np.ndarray]"
Rng = np.random.Generator | int | None


@value
class Multisine:
    """One period of a multisine, for M realisations of its random phases.

    For several inputs the design separates the inputs: by n_u experiments with orthogonal phases, or
    by lines that each excite one input.

    Fields
    ------
    fs : float
        Sampling frequency [Hz].
    n_samples : int
        Samples N in one period.
    kind : str
        Kind of the grid of excited lines, as in `multisine`.
    lines : LineGrid
        Excited lines and detection lines (not excited), the same for all inputs.
    amplitude : (F,) or (n_u, F) ndarray
        Amplitude of the cosine on each excited line, in the unit of the signal. For several inputs
        it is the amplitude before mixing. With the design "zippered" it is zero on the lines of
        another input.
    phase : (M, F) or (n_u, M, F) ndarray
        Phases [rad] of each realisation; for several inputs of each input and experiment, before
        mixing.
    hold : str
        Signal between the samples: "zoh" if a converter holds each sample, "band-limited" if a
        generator has a reconstruction filter, "unknown" otherwise.
    design : str
        For several inputs. "orthogonal": n_u experiments, each with all inputs on all lines.
        "zippered": each line excites one input, and one experiment is enough.
    mixing : (n_u, n_u) ndarray, optional
        Matrix from the designed signals to the inputs of the plant: u = mixing @ signals. None: the
        identity.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.6.1 (eq.
    2-47), 2.7, 3.7 and 5.2; T. Dobrowiecki, J. Schoukens, *Measuring a linear approximation to
    weakly nonlinear MIMO systems*, Automatica 43, 2007.

    Examples
    --------
    >>> ms = multisine(fs=1000, n_samples=1000, f_min=1, f_max=20, rms=2.0, n_realizations=3, rng=1)
    >>> ms.u.shape, ms.f0, round(ms.rms, 12)
    ((3, 1000), 1.0, 2.0)

    Two inputs: each experiment excites both inputs, and two experiments separate them.

    >>> ms = multisine(fs=128, n_samples=128, f_min=1, f_max=40, rms=(1.0, 2.0), n_inputs=2, rng=1)
    >>> ms.u.shape, ms.rms.round(12).tolist()
    ((2, 2, 128), [1.0, 2.0])
    """

    fs: float
    n_samples: int
    kind: str
    lines: LineGrid
    amplitude: np.ndarray
    phase: np.ndarray
    hold: str = "unknown"
    design: str = "orthogonal"
    mixing: ArrayField = None

    def __post_init__(self) -> None:
        require_positive("fs", self.fs)
        require_choice("hold", self.hold, HOLDS)
        require_choice("design", self.design, DESIGNS)
        require_integer("n_samples", self.n_samples, least=4)
        n_lines, last = self.lines.excited.size, self.lines.excited[-1]
        if 2 * last >= self.n_samples:
            raise ValueError(
                f"lines must lie below the Nyquist line {self.n_samples / 2:g}, got line {last}"
            )
        phase = require_real_array("phase", self.phase, ndim=2 if self.is_single else 3)
        amplitude = require_real_array("amplitude", self.amplitude, ndim=phase.ndim - 1)
        if (
            phase.size == 0
            or phase.shape[-1] != n_lines
            or amplitude.shape != (*phase.shape[:-2], n_lines)
        ):
            raise ValueError(
                f"amplitude and phase must have shapes ({n_lines},) and (M, {n_lines}), for several"
                f" inputs (n_u, {n_lines}) and (n_u, M, {n_lines}), got {amplitude.shape} and"
                f" {phase.shape}"
            )
        if np.any(amplitude < 0) or not (
            amplitude.all() if self.is_single else amplitude.any(axis=1).all()
        ):
            raise ValueError(
                "amplitude must be positive on every excited line, zero where it drives another"
                f" input, got {amplitude.min():g}"
            )
        if self.mixing is not None:
            check_mixing(require_real_array("mixing", self.mixing, ndim=2), self.n_inputs)

    @property
    def is_single(self) -> bool:
        """True if the multisine is for one input, so that its arrays have no axis of inputs."""
        return np.ndim(self.phase) == 2

    @property
    def n_inputs(self) -> int:
        """Number of inputs n_u."""
        return math.prod(self.phase.shape[:-2])  # one if there is no axis of inputs

    @property
    def n_experiments(self) -> int:
        """Number of experiments. For one input there is one for each draw of the random phases. For
        several inputs there are n_u for each draw with `design` "orthogonal", and one with
        "zippered".
        """
        return self.phase.shape[-2]

    def describe_extent(self) -> str:
        """Return experiments, samples, lines and hold on one line."""
        runs = format_count(self.n_experiments, "realisation" if self.is_single else "experiment")
        return f"{runs} x {self.n_samples} samples, {describe_band(self.f)}, hold {self.hold}"

    @property
    def n_realizations(self) -> int:
        """Number of realisations (draws of the random phases); for several inputs each is a set of
        experiments that is sufficient to identify the matrix G.
        """
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
    def rms(self) -> ArrayField:
        """Root mean square of one period, equal for all realisations. For several inputs (n_u,):
        that of each input over all experiments of a realisation.
        """
        power = np.sum(self.amplitude**2, axis=-1) / 2
        found = np.sqrt(power if self.mixing is None else self.mixing**2 @ power)
        if self.is_single:
            return float(found)
        return found

    @property
    def u(self) -> np.ndarray:
        """(M, N) ndarray: one period of each realisation; or (n_u, M, N): one period of each input
        and experiment.
        """
        return self.sampled(self.n_samples)

    @property
    def crest_factor(self) -> np.ndarray:
        """(M,) or (n_u, M) ndarray: peak over rms of the samples."""
        return np.asarray(np.abs(self.u).max(axis=-1) / np.expand_dims(self.rms, -1))

    @property
    def spectrum(self) -> np.ndarray:
        """(M, F) or (n_u, M, F) complex ndarray: amplitude and phase of the signals `u` on the
        excited lines.
        """
        logical = self.amplitude[..., np.newaxis, :] * np.exp(1j * self.phase)
        if self.mixing is None:
            return logical
        return np.tensordot(self.mixing, logical, 1)

    def sampled(self, n_samples: int) -> np.ndarray:
        """Return one period with another number of samples: (M, n_samples) or (n_u, M, n_samples)
        ndarray.
        """
        spectrum = np.zeros((*self.phase.shape[:-1], n_samples // 2 + 1), dtype=complex)
        spectrum[..., self.lines.excited] = self.spectrum * (n_samples / 2)
        return np.fft.irfft(spectrum, n_samples, axis=-1)


def require_one_input(ms: object) -> Multisine:
    """Return a multisine for one input; refuse anything else."""
    require_kind("ms", ms, Multisine)
    found = cast("Multisine", ms)
    if not found.is_single:
        raise ValueError(f"ms must be of one input, got one of {found.n_inputs}")
    return found


def multisine(
    kind: str = "special-odd",
    *,
    fs: float,
    n_samples: int,
    f_min: float,
    f_max: float,
    rms: float | Sequence[float] | np.ndarray = 1.0,
    amplitude: Amplitude | None = None,
    lines: LineGrid | np.ndarray | None = None,
    n_log: int | None = None,
    n_realizations: int = 1,
    n_inputs: int = 1,
    design: str = "orthogonal",
    mixing: ArrayLike | None = None,
    n_draws: int = 1,
    rng: Rng = None,
    hold: str = "unknown",
) -> Multisine:
    """Design a random-phase multisine: a sum of cosines with independent phases, uniform on [0, 2
    pi).

    The grid decides which multiples of f0 = fs / n_samples (lines) are excited. Lines without
    excitation are detection lines, on which distortion appears. For most purposes use the default
    grid, "special-odd".

    Parameters
    ----------
    kind : str
        Grid of the excited lines:

        - "special-odd": lines 8k+1 and 8k+3. The distortion on detection lines is lower by at most
          4.8 dB; `identify` corrects this.
        - "random-odd": three of every four odd lines, at random. No correction is needed.
        - "odd-odd": lines 4k+1. Around a resonance it is lower by a factor without an upper limit.
        - "odd": all odd lines, and "full": all lines. There are no odd detection lines.
        - "custom": the given `lines`.
    fs : float
        Sampling frequency [Hz].
    n_samples : int
        Samples N in one period; the frequency resolution is f0 = fs / N.
    f_min, f_max : float
        Band [Hz], both ends included.
    rms : float, or (n_u,) ndarray
        Root mean square of the signal, in its own unit: one number, or one per input.
    amplitude : (F,) or (n_u, F) ndarray, or callable of f [Hz], optional
        Relative amplitude on each excited line, scaled to `rms`; by default all are equal.
    lines : LineGrid or array of int, optional
        The excited lines of a "custom" grid.
    n_log : int, optional
        Approximate number of lines to keep, spaced logarithmically, for a band over decades.
    n_realizations : int
        Number of realisations: draws of the random phases on the same grid, for several inputs each
        a set of experiments.
    n_inputs : int
        Number of inputs n_u of the plant.
    design : str
        For several inputs. "orthogonal": n_u experiments, each with all inputs on all lines.
        "zippered": one experiment, in which each line excites one input; it needs a "random-odd"
        grid.
    mixing : (n_u, n_u) ndarray, optional
        Matrix from the designed signals, which have the `rms`, to the inputs: u = mixing @ signals.
        For an ill-conditioned plant take V S^-1, from the SVD G = U S V^H of a first measurement.
    n_draws : int
        For several inputs, number of random draws of the phases; that of least crest factor (peak
        over rms) is kept.
    rng : numpy Generator, int or None
        Source of the random phases (and of the lines left out of a random-odd grid).
    hold : str
        Signal between the samples: "zoh" if a converter holds each sample, "band-limited" if a
        filter reconstructs the signal. A record made with this design has the same hold.

    Returns
    -------
    Multisine

    Raises
    ------
    ValueError
        The band contains no lines or exceeds the Nyquist frequency; `amplitude` does not fit the
        lines; a number is out of range; or the design is "zippered" on a "special-odd" or "odd-odd"
        grid, for which `identify` cannot estimate the distortion.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 4.3 and 5.

    Examples
    --------
    >>> ms = multisine(fs=1000, n_samples=1000, f_min=1, f_max=20, rms=2.0, rng=1)
    >>> ms.lines.excited.tolist()
    [1, 3, 9, 11, 17, 19]
    >>> float(round(np.sqrt(np.mean(ms.u**2)), 12))
    2.0
    """
    require_choice("kind", kind, KINDS)
    fs, n_inputs = require_positive("fs", fs), require_integer("n_inputs", n_inputs, least=1)
    n_samples = require_integer("n_samples", n_samples, least=4)
    n_realizations = require_integer("n_realizations", n_realizations, least=1)
    rng = random_generator("rng", rng)
    first, last = band_lines(
        fs,
        n_samples,
        f_min=require_positive("f_min", f_min),
        f_max=require_positive("f_max", f_max),
    )
    grid = _grid_in_band(kind, lines, first=first, last=last, rng=rng)
    if n_log is not None:
        grid = _thin_grid(grid, require_integer("n_log", n_log, least=2))
    if n_inputs == 1 and (design != "orthogonal" or mixing is not None or n_draws != 1):
        raise ValueError(
            "n_inputs must be at least 2 for a zippered design, for mixing or for n_draws, got"
            " 1; for one input use reduce_crest"
        )
    shape = _relative_amplitudes(amplitude, grid.excited * fs / n_samples, n_inputs)
    mixing = _checked_mixing(mixing, design)
    if design == "zippered":
        shape = shape * assign_lines(kind, grid, n_inputs=n_inputs, rng=rng)
    size = _rms_per_input(rms, n_inputs) / np.sqrt(np.sum(shape**2, axis=1) / 2)
    scaled = shape * size[:, np.newaxis]

    def draw() -> Multisine:
        """Return one draw of all phases."""
        return Multisine(
            fs=fs,
            n_samples=n_samples,
            kind=kind,
            lines=grid,
            amplitude=scaled[0] if n_inputs == 1 else scaled,
            phase=draw_phases(scaled.shape, n_realizations, design=design, rng=rng),
            hold=hold,
            design=design,
            mixing=mixing,
        )

    if require_integer("n_draws", n_draws, least=1) == 1:
        return draw()
    return min((draw() for _ in range(n_draws)), key=lambda ms: float(ms.crest_factor.max()))


def _checked_mixing(mixing: ArrayLike | None, design: str) -> np.ndarray | None:
    """Return the matrix from the designed signals to the inputs; refuse one for a zippered
    design, and another design.
    """
    require_choice("design", design, DESIGNS)
    if mixing is None:
        return None
    if design == "zippered":
        raise ValueError(
            f"mixing must be left out for a zippered design: a line drives one input, got {mixing}"
        )
    return require_real_array("mixing", mixing, ndim=2)


def _grid_in_band(
    kind: str,
    lines: LineGrid | np.ndarray | None,
    *,
    first: int,
    last: int,
    rng: np.random.Generator,
) -> LineGrid:
    """Return the grid of a kind from the first to the last line of the band, or the given one."""
    if kind == "custom":
        if lines is None:
            raise ValueError("lines must be given for a custom grid, got None")
        if isinstance(lines, LineGrid):
            grid = lines
        else:
            grid = LineGrid(excited=lines)
        if grid.excited[0] < first or grid.excited[-1] > last:
            raise ValueError(
                f"lines must lie inside the band, lines {first} to {last}, "
                f"got lines {grid.excited[0]} to {grid.excited[-1]}"
            )
        return grid
    if lines is not None:
        raise ValueError(f'lines must only be given with kind="custom", got kind={kind!r}')
    try:
        return grid_lines(kind, first, last=last, rng=rng)
    except ValueError:
        raise ValueError(
            f"f_min and f_max must hold at least one line of a {kind} grid between them, got lines"
            f" {first} to {last}"
        ) from None


def _thin_grid(grid: LineGrid, n_log: int) -> LineGrid:
    """Return the lines of a grid nearest to a logarithmic spacing."""
    excited = grid.excited
    wanted = np.geomspace(excited[0], excited[-1], n_log)
    right = np.clip(np.searchsorted(excited, wanted), 1, excited.size - 1)
    left_is_nearer = wanted - excited[right - 1] < excited[right] - wanted
    return LineGrid(excited=excited[np.unique(right - left_is_nearer)])


def band_lines(fs: float, n_samples: int, *, f_min: float, f_max: float) -> tuple[int, int]:
    """Return the first and last line of the band f_min..f_max, with a tolerance for rounding of the
    frequencies.
    """
    f0 = fs / n_samples
    if f_max < f_min:
        raise ValueError(f"f_max must be at least f_min = {f_min:g} Hz, got {f_max:g} Hz")
    if f_max >= fs / 2 * (1 + 1e-9):
        raise ValueError(
            f"f_max must lie below the Nyquist frequency {fs / 2:g} Hz, got {f_max:g} Hz"
        )
    first = max(1, int(np.ceil(f_min / f0 - 1e-6)))
    last = min(int(np.floor(f_max / f0 + 1e-6)), (n_samples - 1) // 2)
    if last < first:
        raise ValueError(
            f"f_min and f_max must hold a multiple of the resolution {f0:g} Hz between them, "
            f"got {f_min:g} to {f_max:g} Hz"
        )
    return first, last


def _relative_amplitude(amplitude: np.ndarray | None, f: np.ndarray) -> np.ndarray:
    """Return the (F,) relative amplitudes for one input at frequencies f [Hz]."""
    if amplitude is None:
        shape = np.ones(f.size)
    else:
        shape = np.asarray(amplitude)
    if shape.dtype.kind not in "fiu":
        raise ValueError(
            "amplitude must be numbers, or a function of f that gives them, got"
            f" {short_form(amplitude)}"
        )
    shape = shape.astype(float)
    if shape.shape != f.shape:
        raise ValueError(
            f"amplitude must have one value per excited line ({f.size}), got shape {shape.shape}"
        )
    if not np.all(np.isfinite(shape)) or np.any(shape <= 0):
        raise ValueError(
            "amplitude must be finite and positive on every excited line, got"
            f" {short_form(float(shape.min()))}"
        )
    return shape


def _relative_amplitudes(amplitude: Amplitude | None, f: np.ndarray, n_inputs: int) -> np.ndarray:
    """Return the (n_u, F) relative amplitudes for several inputs."""
    given = amplitude(f) if callable(amplitude) else amplitude
    if given is not None and np.ndim(given) == 2:
        if len(given) != n_inputs:
            raise ValueError(
                f"amplitude must have one row per input ({n_inputs}), got {len(given)}"
            )
        return np.stack([_relative_amplitude(row, f) for row in given])
    return np.tile(_relative_amplitude(given, f), (n_inputs, 1))


def _rms_per_input(rms: float | Sequence[float] | np.ndarray, n_inputs: int) -> np.ndarray:
    """Return (n_u,) root mean square of each input."""
    if np.ndim(rms) == 0:
        return np.full(n_inputs, require_positive("rms", rms))
    if np.shape(rms) != (n_inputs,):
        raise ValueError(
            f"rms must be one number, or one per input ({n_inputs}), got shape {np.shape(rms)}"
        )
    return np.array(
        [require_positive(f"rms[{i}]", float(one)) for i, one in enumerate(np.asarray(rms))]
    )
