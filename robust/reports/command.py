"""Reading, pictures and reports of the command `robust`, for results of one or several channels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import nlfrf
from nlfrf._base.arguments import require_nonnegative, require_positive
from nlfrf._base.command import spinner
from nlfrf._base.files import command_signature, write_text
from robust._base.channels import is_single
from robust.analysis.loop_level import LoopSignals, NoiseSignal, StepSignal
from robust.analysis.performance import loop_gains
from robust.io.certificates import certificate_path, save_certificate, verify_certificate
from robust.io.models import load_model
from robust.lti.sampling import discretize
from robust.models.fit.weights import performance_weight
from robust.models.sets.model import has_several_channels

__all__ = [
    "check_pictures",
    "demand_weight",
    "load_blas",
    "load_single_model",
    "model_pictures",
    "signals_from_options",
    "write_report_files",
]


Pictures = list[tuple[Callable[..., Any], Any]]


def load_blas(paths: Sequence[Path]) -> Any:
    """Return what was identified: a BLA or a matrix, or a list of one kind."""
    found = [nlfrf.load(path) for path in paths]
    for path, one in zip(paths, found, strict=True):
        if not isinstance(one, nlfrf.Bla) or is_single(one) != is_single(found[0]):
            raise ValueError(f"bla must be BLAs or matrices, all of one kind, got {path} with {type(one).__name__}")
    return found[0] if len(found) == 1 else found


def load_single_model(path: Path) -> Any:
    """Return the model of one input and output in a file, for a command that takes no other."""
    model = load_model(path)
    if has_several_channels(model):
        raise ValueError(
            f"model must be of one input and output for this command, got {path} with {model.n_outputs} outputs by "
            f"{model.n_inputs} inputs; robust check and robust export take it"
        )
    return model


def demand_weight(model: Any, bandwidth: float | None, peak: float, error: float) -> Any:
    """Return the performance weight for a bandwidth [Hz], on the time base of a matrix; None without a bandwidth."""
    if bandwidth is None:
        return None
    w_P = performance_weight(2 * np.pi * bandwidth, M_S=peak, A=error)
    return discretize(w_P, model.nominal.dt) if has_several_channels(model) and model.nominal.dt else w_P


def signals_from_options(
    step: float | None, disturbance: float | None, noise: float | None, up_to: float | None
) -> LoopSignals | None:
    """Return the signals that the options name: a height, two rms, the end of a band [Hz]; None without one."""
    end = float("nan") if up_to is None else 2 * np.pi * require_positive("up-to", up_to)
    signals: dict[str, Any] = {} if step is None else {"reference": StepSignal(step)}
    for name, rms in (("disturbance", disturbance), ("noise", noise)):
        if rms is not None:
            signals[name] = NoiseSignal(require_nonnegative(name, rms), omega_max=end)
    return LoopSignals(**signals) if signals else None


def model_pictures(model: Any, blas: Any) -> Pictures:
    """Return a model as `robust model` draws it."""
    from robust import plot

    return [(plot.plot_weight, model), (lambda one, ax: plot.plot_bode(one, blas, ax=ax), model)]


def check_pictures(model: Any, K: Any, report: Any) -> Pictures:
    """Return a check as `robust check` draws it."""
    from robust import plot

    if has_several_channels(model):
        gains = loop_gains(model.nominal, K, omega=model.omega)
        return [(plot.plot_matrix_loop, gains), (plot.plot_check, report)]
    return [(plot.plot_loop, report), (plot.plot_check, report)]


def write_report_files(report: Any, out: Path, say: Any) -> None:
    """Write a report, and next to it a verified certificate of what was proved."""
    write_text(out, f"{report}\n\n{command_signature('robust check')}\n")
    handed = certificate_path(out)
    if any(certificate.holds and certificate.claim is not None for certificate in report.certificates):
        save_certificate(report, handed)
        with spinner("verifying"):
            say(verify_certificate(handed))
    elif handed.exists():
        say(f"{handed} is of an earlier run: this one proved nothing that it could hold")
