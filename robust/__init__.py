"""Robust control design on a measured FRF: uncertainty models, weights, controllers, and a check with proofs.

    Bla -> fit_nominal -> uncertainty -> UncertaintyModel -> ncfsyn -> K -> check -> RobustnessReport

Nothing heavy is loaded before it is used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robust.certify import Certificate, certify_norm
    from robust.check import check
    from robust.disk import DiskMargin, disk_margin
    from robust.dk import DkDesign, dk_iteration
    from robust.elements import lag, lead, notch, pid, roll_off
    from robust.export import export_matlab
    from robust.formulas import control_weight, delay_weight, performance_weight
    from robust.frf_design import design_frf
    from robust.gap import ncf_margin, nu_gap
    from robust.handover import write_report
    from robust.hinfsyn import Synthesis, hinfsyn
    from robust.interconnection import Block, UncertainSystem, interconnection
    from robust.mixed import mixsyn
    from robust.model_files import load_controller, load_model, save_controller, save_model
    from robust.mu import MuBound, mu_upper
    from robust.mu_certify import certify_mu
    from robust.mu_gain import mu_upper_lmi, worst_gain
    from robust.mu_lower import mu_lower
    from robust.nominal import NominalFit, fit_nominal, frd
    from robust.orders import OrderScan, scan_orders
    from robust.report import RobustnessReport
    from robust.sampling import discretize, sampled
    from robust.sections import controller_sections
    from robust.shaping import Design, crossover_weight, ncfsyn
    from robust.structured import StructuredReport, check_structure
    from robust.uncertainty import UncertaintyModel, uncertainty
    from robust.validation import Validation, validate
    from robust.weights import WeightFit, fit_weight
    from robust.worst import LoopFamily, WorstCase, loop_bounds, sample_loops, worst_case


class DesignWarning(UserWarning):
    """A result that is usable but suspicious: the model or the design limits what it means.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", DesignWarning)  # to stop at every suspicious result
    """


HOMES = {
    "Block": "interconnection",
    "Certificate": "certify",
    "Design": "shaping",
    "DiskMargin": "disk",
    "DkDesign": "dk",
    "LoopFamily": "worst",
    "MuBound": "mu",
    "NominalFit": "nominal",
    "OrderScan": "orders",
    "RobustnessReport": "report",
    "StructuredReport": "structured",
    "Synthesis": "hinfsyn",
    "UncertainSystem": "interconnection",
    "UncertaintyModel": "uncertainty",
    "Validation": "validation",
    "WeightFit": "weights",
    "WorstCase": "worst",
    "certify_mu": "mu_certify",
    "certify_norm": "certify",
    "check": "check",
    "check_structure": "structured",
    "control_weight": "formulas",
    "controller_sections": "sections",
    "crossover_weight": "shaping",
    "delay_weight": "formulas",
    "design_frf": "frf_design",
    "discretize": "sampling",
    "disk_margin": "disk",
    "dk_iteration": "dk",
    "export_matlab": "export",
    "fit_nominal": "nominal",
    "fit_weight": "weights",
    "frd": "nominal",
    "hinfsyn": "hinfsyn",
    "interconnection": "interconnection",
    "lag": "elements",
    "lead": "elements",
    "load_controller": "model_files",
    "load_model": "model_files",
    "loop_bounds": "worst",
    "mu_lower": "mu_lower",
    "mu_upper": "mu",
    "mu_upper_lmi": "mu_gain",
    "mixsyn": "mixed",
    "ncf_margin": "gap",
    "ncfsyn": "shaping",
    "notch": "elements",
    "nu_gap": "gap",
    "performance_weight": "formulas",
    "pid": "elements",
    "roll_off": "elements",
    "sample_loops": "worst",
    "sampled": "sampling",
    "save_controller": "model_files",
    "save_model": "model_files",
    "scan_orders": "orders",
    "uncertainty": "uncertainty",
    "validate": "validation",
    "worst_case": "worst",
    "worst_gain": "mu_gain",
    "write_report": "handover",
}

__all__ = [
    "Block",
    "Certificate",
    "Design",
    "DesignWarning",
    "DiskMargin",
    "DkDesign",
    "LoopFamily",
    "MuBound",
    "NominalFit",
    "OrderScan",
    "RobustnessReport",
    "StructuredReport",
    "Synthesis",
    "UncertainSystem",
    "UncertaintyModel",
    "Validation",
    "WeightFit",
    "WorstCase",
    "certify_mu",
    "certify_norm",
    "check",
    "check_structure",
    "control_weight",
    "controller_sections",
    "crossover_weight",
    "delay_weight",
    "design_frf",
    "discretize",
    "disk_margin",
    "dk_iteration",
    "export_matlab",
    "fit_nominal",
    "fit_weight",
    "frd",
    "hinfsyn",
    "interconnection",
    "lag",
    "lead",
    "load_controller",
    "load_model",
    "loop_bounds",
    "mixsyn",
    "mu_lower",
    "mu_upper",
    "mu_upper_lmi",
    "ncf_margin",
    "ncfsyn",
    "notch",
    "nu_gap",
    "performance_weight",
    "pid",
    "roll_off",
    "sample_loops",
    "sampled",
    "save_controller",
    "save_model",
    "scan_orders",
    "uncertainty",
    "validate",
    "worst_case",
    "worst_gain",
    "write_report",
]


def __getattr__(name: str) -> Any:
    """A public name, loaded with its module when it is first asked for (PEP 562)."""
    if name in HOMES:
        return getattr(import_module(f"robust.{HOMES[name]}"), name)
    raise AttributeError(f"module 'robust' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


class LazyPackage(ModuleType):
    """Some functions are called like the module they live in: importing the module must not hide the function."""

    def __setattr__(self, name: str, content: Any) -> None:
        if not (name in HOMES and isinstance(content, ModuleType)):
            super().__setattr__(name, content)


sys.modules[__name__].__class__ = LazyPackage
