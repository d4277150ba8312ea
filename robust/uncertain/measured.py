"""A plant that is known on measured lines only, as a controller sees it."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf.shared.wording import shown
from robust.modelling.nominal import frd
from robust.systems.lti import response
from robust.uncertain.forms import RELATIVE
from robust.uncertain.model import UncertaintyModel
from robust.uncertain.radius import record_disc, total_of

__all__ = ["as_seen", "on_lines", "sampling_time"]


def sampling_time(model: Any) -> float:
    """Of an FRF that says it is a sampled one; 0 otherwise."""
    source = model.nominal if isinstance(model, UncertaintyModel) else model
    return float(getattr(source, "dt", 0) or 0)


def as_seen(model: Any, omega: np.ndarray, G: np.ndarray, dt: float, delay: float) -> np.ndarray:
    """(W,) an FRF with the delay, and with zero-order hold where the controller is sampled and the FRF is not.

    What folds down from above Nyquist is not known and left out.
    """
    if dt and not sampling_time(model):
        x = omega * dt / 2
        G = G * np.sin(x) / x * np.exp(-1j * x)
    return G * np.exp(-1j * omega * delay)


def on_lines(model: Any) -> tuple[np.ndarray, np.ndarray, str, np.ndarray, str]:
    """Frequencies, plant, form, weight (nan: none) and class of whatever FRF was given."""
    if isinstance(model, Bla):
        disc = total_of(record_disc(model, frd(model), 0.95, False, True, None))
        return model.omega, model.G, RELATIVE, disc / np.abs(model.G) + 0j, "statistical"
    if isinstance(model, control.FrequencyResponseData):
        if (model.ninputs, model.noutputs) != (1, 1):
            raise ValueError(f"model must have one input and one output, got {shown(model)}")
        omega = np.asarray(model.omega, dtype=float)
        return omega, np.asarray(model.frdata[0, 0]), RELATIVE, np.full(omega.size, np.nan + 0j), "LTI"
    weight = response(model.weight, model.omega)
    return model.omega, model.at(model.omega), model.form, weight, model.perturbation
