"""``Frm``: the frequency response matrix of a nonlinear system of several inputs or outputs, and its bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nlfrf._base.arguments import integer, one_of, probability
from nlfrf._base.numbers import roy_quantile
from nlfrf._base.values import Sketch, value
from nlfrf.bla.bla import Bla, DistortionLevels
from nlfrf.signals.lines import LineGrid

__all__ = ["Frm", "excess", "in_own_units"]


#: Share of the distortion that bends the FRF smoothly, so that its roughness does not show it (as in `Bla`).
SMOOTH = 0.3
COVARIANCES = ("cov_noise", "cov_total", "cov_distortion", "cov_even", "cov_bound")
FLOOR = 1e-8  # of the largest eigenvalue of a correlation: one nonlinearity alone makes one of rank one


@value
class Frm:
    """Best linear approximation of a system of several inputs and outputs on the excited lines, with its covariance.

    The covariance of the matrix has two factors: Cov(vec G) = conj(gamma) kron cov, vec stacking columns. `cov_*` are
    of the residual Y - G U of ONE experiment, `gamma` is what the estimation makes of it; E|.|^2 of complex numbers.

    Fields
    ------
    f : (F,) ndarray
        Excited frequencies [Hz].
    G : (n_y, n_u, F) complex ndarray
        The matrix, unit of y over unit of u.
    inputs, outputs : tuple of str
        Names of the channels.
    lines : LineGrid
        Excited and detection lines.
    grid : str
        The kind of grid that was recognised.
    design : str
        "orthogonal" or "zippered", as recognised.
    fs : float
        Sampling frequency [Hz].
    n_samples : int
        Samples N in one period.
    n_realizations, n_experiments, n_periods : int
        Sets R, experiments M and periods P behind it.
    transient : str
        What was done about the transient: "none", "discard" or "local".
    level_source : str
        Where the distortion level comes from, as in `Bla`.
    gamma : (n_u, n_u, F) complex ndarray
        Diagonal, 1/(M A_i^2), in open loop; full in closed loop.
    cov_noise : (n_y, n_y, F) complex ndarray
        By noise; nan for P = 1.
    cov_total : (n_y, n_y, F) complex ndarray
        By noise and distortion.
    cov_distortion : (n_y, n_y, F) complex ndarray
        By distortion: the part of cov_total - cov_noise without negative eigenvalues.
    cov_even : (n_y, n_y, F) complex ndarray
        What the even lines say, noise included; nan without them.
    cov_bound : (n_y, n_y, F) complex ndarray
        The one behind `bound` and `block`: `cov_total`, pooled with the detection lines where R >= 2.
    dof : (F,) ndarray
        Complex degrees of freedom behind cov_bound.
    grid_factor : (F,) ndarray
        Variance at an excited line over the mean on its window of detection lines, as applied.
    levels : tuple of DistortionLevels
        Amplitudes of each output on excited and detection lines.
    typical : float
        How much more a set of random phases distorts than those at hand, by the cube of each input, on average over
        them: as in `Bla`.
    hold : str
        How the inputs ran between their samples, as the `MultiRecord` says: with "zoh" the hold of 1/fs is in G.

    Raises
    ------
    ValueError
        Parts whose shapes do not belong to one another.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.7, 3.7 and 4.3; C. G. Khatri,
    *Distribution of the largest or the smallest characteristic root under null hypothesis concerning complex
    multivariate normal populations*, Ann. Math. Statist. 35, 1964.

    Examples
    --------
    Two inputs, two outputs, a weak cube of the first input.

    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    >>> u = np.repeat(ms.u[:, :, None], 2, axis=2)                       # two periods
    >>> y = np.stack([2 * u[0] + 0.1 * u[0] ** 3 + u[1], u[1]])
    >>> frm = nlfrf.identify(nlfrf.MultiRecord(u=u, y=y, fs=256, lines=ms.lines))
    >>> frm.G.shape, bool(np.all(np.abs(frm.G[0, 0] - 2.3) < frm.bound(simultaneous=True)[0, 0]))
    ((2, 2, 26), True)
    """

    f: np.ndarray
    G: np.ndarray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    lines: LineGrid
    grid: str
    design: str
    fs: float
    n_samples: int
    n_realizations: int
    n_experiments: int
    n_periods: int
    transient: str
    level_source: str
    gamma: np.ndarray
    cov_noise: np.ndarray
    cov_total: np.ndarray
    cov_distortion: np.ndarray
    cov_even: np.ndarray
    cov_bound: np.ndarray
    dof: np.ndarray
    grid_factor: np.ndarray
    levels: tuple[DistortionLevels, ...]
    typical: float = 1.0
    hold: str = "unknown"

    def __post_init__(self) -> None:
        n_y, n_u, F = len(self.outputs), len(self.inputs), self.f.size
        shapes: dict[str, tuple[int, ...]] = {"f": (F,), "G": (n_y, n_u, F), "gamma": (n_u, n_u, F)}
        shapes |= dict.fromkeys(COVARIANCES, (n_y, n_y, F)) | dict.fromkeys(("dof", "grid_factor"), (F,))
        for name, shape in shapes.items():
            array = np.asarray(getattr(self, name))
            if array.shape != shape or array.dtype.kind not in "fiuc":
                raise ValueError(
                    f"{name} must be numbers of shape {shape}, for {n_y} outputs, {n_u} inputs and {F} lines, "
                    f"got shape {array.shape}"
                )
        if len(self.levels) != n_y:
            raise ValueError(f"levels must be one an output, {n_y} of them, got {len(self.levels)}")

    @property
    def omega(self) -> np.ndarray:
        """(F,) excited frequencies [rad/s]."""
        return 2 * np.pi * self.f

    @property
    def n_inputs(self) -> int:
        """Inputs n_u."""
        return self.G.shape[1]

    @property
    def n_outputs(self) -> int:
        """Outputs n_y."""
        return self.G.shape[0]

    @property
    def var_noise(self) -> np.ndarray:
        """(n_y, n_u, F) variance of each entry by noise; nan for P = 1."""
        return self.entries(self.cov_noise)

    @property
    def var_total(self) -> np.ndarray:
        """(n_y, n_u, F) variance of each entry by noise and distortion."""
        return self.entries(self.cov_total)

    @property
    def var_distortion(self) -> np.ndarray:
        """(n_y, n_u, F) variance of each entry about the BLA by distortion in one set; it does not shrink with R."""
        return self.n_realizations * self.entries(self.cov_distortion)

    def entries(self, cov: np.ndarray) -> np.ndarray:
        """(n_y, n_u, F) variances of the entries under a covariance (n_y, n_y, F) of one experiment."""
        return np.einsum("jjk->jk", cov).real[:, None] * np.einsum("iik->ik", self.gamma).real

    def covariance(self) -> np.ndarray:
        """(n_y n_u, n_y n_u, F) covariance of vec G, columns of G one after the other: conj(gamma) kron cov_bound."""
        n = self.n_inputs * self.n_outputs
        both = np.einsum("abk,cdk->acbdk", self.gamma.conj(), self.cov_bound)
        return both.reshape(n, n, -1)

    def covariance_of(self, of: str) -> np.ndarray:
        """(n_y, n_y, F) covariance of one experiment behind a bound: of the BLA, or of a new set about G."""
        one_of("of", of, ("bla", "realization"))
        if of == "bla":
            return self.cov_bound
        scatter = self.n_realizations * self.typical * (1 + SMOOTH * ("roughness" in self.level_source))
        return self.cov_bound + scatter * excess(self.cov_bound, np.nan_to_num(self.cov_noise))

    def bound(self, confidence: float = 0.95, *, of: str = "bla", simultaneous: bool = False) -> np.ndarray:
        """Radius of the disc around each entry that holds the truth with the stated probability.

        Parameters
        ----------
        confidence : float
            Probability, strictly between 0 and 1.
        of : str
            "bla": the disc holds the best linear approximation. "realization": that of a new set of experiments.
        simultaneous : bool
            True: the probability holds for all lines and all entries together.

        Returns
        -------
        (n_y, n_u, F) ndarray
            sqrt(F_p gamma_ii cov_jj), with F_p the p-quantile of F(2, 2 dof).
        """
        p = probability("confidence", confidence)
        if simultaneous:
            p = p ** (1 / self.G.size)
        quantile = self.dof * np.expm1(-np.log1p(-p) / self.dof)
        return np.sqrt(quantile * self.entries(self.covariance_of(of)))

    def block(
        self, confidence: float = 0.95, *, of: str = "bla", simultaneous: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """The set {G + left Delta right, sigma_max(Delta) <= 1} that holds the whole matrix of a line.

        By the exact law of the largest singular value of C^-1/2 dG gamma^-1/2 (Roy's largest root), which is free of
        unknowns. An ellipsoid would gain nothing: the smallest destabilising Delta has rank one.

        Parameters
        ----------
        confidence, of, simultaneous
            As in `bound`; simultaneous: for all lines together.

        Returns
        -------
        left, right : (n_y, n_y, F), (n_u, n_u, F) complex ndarray
            With left left^H = x_p C and right^H right = gamma.
        """
        p = probability("confidence", confidence)
        if simultaneous:
            p = p ** (1 / self.f.size)
        x = np.array([roy_quantile(p, self.n_outputs, self.n_inputs, float(L)) for L in self.dof])
        return np.sqrt(x) * root(self.covariance_of(of)), np.swapaxes(root(self.gamma), 0, 1).conj()

    def entry(self, output: int, input: int) -> Bla:
        """One entry as a `Bla`: whatever takes one input and one output takes it."""
        j, i = integer("output", output, least=0), integer("input", input, least=0)
        if j >= self.n_outputs or i >= self.n_inputs:
            raise ValueError(
                f"output and input must be below {self.n_outputs} and {self.n_inputs}, got {output} and {input}"
            )
        gamma = self.gamma[i, i].real
        noise, total, bound = (gamma * cov[j, j].real for cov in (self.cov_noise, self.cov_total, self.cov_bound))
        R = self.n_realizations
        return Bla(
            f=self.f,
            G=self.G[j, i],
            lines=self.lines,
            grid=self.grid,
            fs=self.fs,
            n_samples=self.n_samples,
            n_realizations=R,
            n_periods=self.n_periods,
            transient=self.transient,
            level_source=self.level_source,
            var_noise=noise,
            var_total=total,
            var_distortion=R * np.maximum(total - np.nan_to_num(noise), 0.0),
            var_even=R * gamma * self.cov_even[j, j].real,
            dof=self.dof,
            grid_factor=self.grid_factor,
            levels=self.levels[j],
            var_bound=bound,
            typical=self.typical,
            hold=self.hold,
        )

    def every(self, step: int) -> Frm:
        """The same on every so many-th of its excited lines: for a fit that does not need them all."""
        some = slice(None, None, integer("step", step, least=1))
        per_line = ("f", "G", "gamma", *COVARIANCES, "dof", "grid_factor")
        levels = tuple(
            replace(one, **{name: getattr(one, name)[..., some] for name in ("f_excited", "excited", "noise_excited")})
            for one in self.levels
        )
        lines = replace(self.lines, excited=self.lines.excited[some])
        return replace(self, lines=lines, levels=levels, **{name: getattr(self, name)[..., some] for name in per_line})

    def times(self, factor: np.ndarray) -> Frm:
        """The same with G times a factor (F,) on each line, and its covariances times the square of that.

        What the output holds, `levels`, stays as it was measured.
        """
        square = np.abs(factor) ** 2
        scaled = {name: getattr(self, name) * square for name in COVARIANCES}
        return replace(self, G=self.G * factor, **scaled)

    def _sketch_(self) -> Sketch:
        """The singular values, for a notebook."""
        with np.errstate(divide="ignore"):
            sizes = 20 * np.log10(np.linalg.svd(np.moveaxis(self.G, 2, 0), compute_uv=False).T)
        return Sketch("Hz", "dB", [(f"sigma {i + 1}", self.f, one) for i, one in enumerate(sizes)], log=True)

    def __str__(self) -> str:
        """What was found, in a few lines."""
        gain = np.abs(self.G)
        rows = [
            f"FRM of {self.n_outputs} outputs by {self.n_inputs} inputs on {self.f.size} lines from {self.f[0]:g} to "
            f"{self.f[-1]:g} Hz, {self.design} {self.grid}, R = {self.n_realizations}, M = {self.n_experiments}, "
            f"P = {self.n_periods}"
        ]
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = middle(self.bound() / gain)
            distortion = 10 * np.log10(middle(self.var_distortion / gain**2))
            noise = 10 * np.log10(middle(self.n_realizations * self.var_noise / gain**2))
        told = np.isfinite(self.var_noise).any()  # not off a single period
        for j, out in enumerate(self.outputs):
            for i, name in enumerate(self.inputs):
                k = int(gain[j, i].argmax())
                rows.append(
                    f"  {out} by {name}: largest |G| {gain[j, i, k]:.4g} at {self.f[k]:g} Hz; 95 % "
                    f"bound {100 * relative[j, i]:.2g} % of |G|; "
                    + (f"noise {noise[j, i]:.0f} dB, distortion" if told else "distortion and noise")
                    + f" {distortion[j, i]:.0f} dB"
                )
        rows.append(f"  medians over lines, of one set; transient: {self.transient}; level from {self.level_source}")
        return "\n".join(rows)


def middle(share: np.ndarray) -> np.ndarray:
    """(n_y, n_u) median over lines of shares of |G|; nothing of nothing is none."""
    return np.asarray(np.median(np.nan_to_num(share, nan=0.0, posinf=np.inf), axis=2))


def excess(cov: np.ndarray, part: np.ndarray) -> np.ndarray:
    """(n, n, F) Hermitian matrices less a part of them, without negative eigenvalues in the units of the first."""
    _, size = in_own_units(cov)
    values, vectors = np.linalg.eigh(np.moveaxis((cov - part) / (size[:, None] * size), 2, 0))
    left = (vectors * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(vectors, 1, 2).conj()
    return np.asarray(np.moveaxis(left, 0, 2) * size[:, None] * size)


def in_own_units(cov: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The correlation (n, n, F) of a covariance and the sizes (n, F) of its channels.

    What floors or cuts eigenvalues does it there: those of a covariance are of sums of metres and newtons.
    """
    size = np.sqrt(np.einsum("jjk->jk", cov).real)
    size = np.where(size > 0, size, 1.0)
    return cov / (size[:, None] * size), size


def root(cov: np.ndarray) -> np.ndarray:
    """(n, n, F) roots L with L L^H = cov, with eigenvalues floored so that they can be divided by."""
    correlation, size = in_own_units(cov)
    values, vectors = np.linalg.eigh(np.moveaxis(correlation, 2, 0))
    values = np.maximum(values, FLOOR * values[:, -1:])
    half = (vectors * np.sqrt(values)[:, None]) @ np.swapaxes(vectors, 1, 2).conj()
    return np.asarray(size[:, None] * np.moveaxis(half, 0, 2))
