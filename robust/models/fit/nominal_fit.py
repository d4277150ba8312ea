"""`NominalFit`, a nominal model with the quality of its fit; any nominal as a plant."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import format_hertz
from nlfrf._base.values import value
from robust._base.types import AnySystem, SystemField
from robust.lti.connections import block_diagonal, in_series
from robust.lti.lti import timebase
from robust.lti.realisation import state_space
from robust.lti.sampling import delayed
from robust.models.fit.fit_uncertainty import FitUncertainty, format_roots


@value
class NominalFit:
    """A parametric model of a measured FRF, with the quality of its fit.

    Fields
    ------
    G : control.StateSpace
        The model without its delay, continuous (dt = 0) or discrete.
    delay, delays : float, (n_u,) ndarray
        Delay [s] in series with G.
    omega : (F,) ndarray
        Frequencies of the fitted lines [rad/s]; the lines of several records are concatenated.
    response : (F,) complex ndarray, or (n_y, n_u, F)
        Response of the model at these lines, delay included.
    residual : (F,) complex ndarray, or (n_y, n_u, F)
        Measured FRF minus `response`.
    std : (F,) ndarray, or (n_y, n_u, F)
        Standard deviation of the measured FRF on each line; nan without variances.
    std_given : bool
        True if `std` was given for an FRF of another program. Then `uncertainty` takes this FRF with
        the fit.
    cost : float
        Sum of |residual|^2 / std^2.
    expected_cost : float
        Expected cost of a model without error, from the variance of the FRF alone; nan without
        variances. A cost well above the expected cost shows undermodelling, which `uncertainty`
        adds to the radius.
    n_parameters : int
        Number of free real parameters.
    class_std : (F,) ndarray, or (n_y, n_u, F)
        Estimated standard deviation of the model error on each line. The fit weights each line by
        1/(std^2 + class_std^2). Zero if the variance of the FRF explains the residual.
    unlikelihood : float
        Negative log likelihood of the fit including the model error, up to a constant that depends
        on the variance of the FRF only.
    omega_c : float
        Crossover [rad/s] of the loop for which the model was fitted; nan if none was given.
    uncertainty : FitUncertainty
        Standard deviations of poles, zeros, gain and delay; None if the model does not come from
        `fit_nominal`.
    p_value : float
        Probability of a cost at least as large for a model without error; nan without variances.
    hold : str
        Hold of the record. "zoh" or "band-limited": the fit takes the hold into account, so that a
        continuous model is the plant without a hold, and a discrete model is the plant with a
        zero-order hold of dt. "unknown": the fit takes no hold into account.
    unit, inputs, outputs : str, tuple of str, tuple of str
        Unit of the response, if the record has one, and for several channels the names of inputs
        and outputs.
    warnings : tuple of str
        Warnings about the records and the fit.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 9 and 11 (cost and its expectation).

    Examples
    --------
    >>> from robust import fit_nominal
    >>> omega = np.linspace(1, 20, 30)
    >>> fit = fit_nominal(control.FrequencyResponseData(1 / (1j * omega + 3), omega), n_poles=1)
    >>> fit.G.poles().real.round(9).tolist(), bool(np.abs(fit.residual).max() < 1e-9)
    ([-3.0], True)
    """

    G: control.StateSpace
    delay: float
    omega: np.ndarray
    response: np.ndarray
    residual: np.ndarray
    std: np.ndarray
    cost: float
    expected_cost: float
    n_parameters: int
    class_std: np.ndarray
    unlikelihood: float
    p_value: float
    omega_c: float
    uncertainty: FitUncertainty | None = None
    hold: str = "unknown"
    unit: str = ""
    delays: np.ndarray | None = None
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    std_given: bool = False
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        ratio = self.cost / self.expected_cost
        if self.G.dt:
            kind = f"sampled at {1 / self.G.dt:g} Hz"
        else:
            kind = "continuous"
        delays = np.unique(self.delay if self.delays is None else self.delays)
        delays_in_ms = ", ".join(f"{1e3 * tau:.3g}" for tau in delays)
        return (
            f"nominal model: {self.G.nstates} poles, {kind}, delay {delays_in_ms} ms; "
            f"cost {self.cost:.4g}, {ratio:.3g} times that of scatter alone"
            + ("" if np.isnan(self.p_value) else f" (p = {self.p_value:.2g})")
            + (f"\n  {self.describe_class_error()}" if np.any(self.class_std) else "")
            + format_roots(self.uncertainty, bool(self.G.dt), self.unit)
        )

    @property
    def criterion(self) -> float:
        """Bayesian information criterion: negative log likelihood + n_parameters ln(2 n_lines)/2,
        with n_lines lines.
        """
        return float(self.unlikelihood + self.n_parameters / 2 * np.log(2 * self.response.size))

    def describe_class_error(self) -> str:
        """Describe the model error relative to |G|: its maximum, and its maximum below the
        crossover.
        """
        channels = tuple(range(self.response.ndim - 1))
        beyond = np.sum(
            np.maximum(np.abs(self.residual) ** 2 - np.nan_to_num(self.std) ** 2, 0.0),
            axis=channels,
        )
        size = np.sum(np.abs(self.response + self.residual) ** 2, axis=channels)
        share = np.sqrt(beyond / np.maximum(size, np.finfo(float).tiny))
        low, worst = ~(self.omega > self.omega_c), int(np.argmax(share))
        if np.isnan(self.omega_c):
            band = ""
        else:
            band = f" below {format_hertz(self.omega_c)}"
        return (
            f"error of the class: {np.sqrt(np.mean(share[low] ** 2)):.2g} of |G|{band} (rms over"
            f" lines), at most {share[worst]:.2g} of |G| at {format_hertz(self.omega[worst])}"
        )


_PADE_ORDER, _PADE_ORDER_PER_INPUT = 4, 2  # order for one delay, and for each of several inputs


@value(copy=False)
class GivenNominal:
    """A nominal from a user: a system, an FRF or a number, and what a fit adds to it."""

    plant: SystemField  # with the delays of its inputs included
    delay: float = 0.0  # the longest of them [s]
    omega_c: float = float("nan")  # crossover that it was fitted for [rad/s]; nan if none was named
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()


def given_nominal(nominal: NominalFit | AnySystem | float) -> GivenNominal:
    """Return a nominal with the delays of a fit included; a system unchanged."""
    if not isinstance(nominal, NominalFit):
        return GivenNominal(plant=nominal)
    plant, delay = _plant_with_delays(nominal)
    return GivenNominal(
        plant=plant,
        delay=delay,
        omega_c=nominal.omega_c,
        inputs=nominal.inputs,
        outputs=nominal.outputs,
    )


def _plant_with_delays(nominal: NominalFit) -> tuple[control.StateSpace, float]:
    """Return the plant of a fit with the delays of its inputs included, and the longest [s]."""
    G, delays = nominal.G, nominal.delays
    if G.ninputs == G.noutputs == 1:
        return delayed(G, nominal.delay, order=_PADE_ORDER), nominal.delay
    if delays is None or not np.any(delays):
        return G, 0.0
    through = control.StateSpace([], [], [], [[1.0]], G.dt)
    each = [delayed(through, float(tau), order=_PADE_ORDER_PER_INPUT) for tau in delays]
    return in_series(block_diagonal(each, G.dt), G), float(np.max(delays))


def single_nominal(
    nominal: NominalFit | AnySystem | float,
) -> tuple[control.StateSpace | control.FrequencyResponseData, float]:
    """Return a nominal with one channel, with its delay inside, and that delay [s]."""
    given = given_nominal(nominal)
    plant = given.plant
    if not isinstance(plant, control.FrequencyResponseData):
        plant = state_space("nominal", plant)
    return plant, given.delay


def sampling_time_of(nominal: control.StateSpace | control.FrequencyResponseData) -> float:
    """Return the sampling time [s] of a nominal, 0 for an FRF."""
    if isinstance(nominal, control.FrequencyResponseData):
        return 0.0
    return timebase(nominal)
