"""The names that scripts, exports and checks outside this repository rely on: they stay."""

import inspect

import pytest

import nlfrf
import robust
from nlfrf import friction, hysteresis
from nlfrf._base.values import field_names

CALLS = {
    nlfrf.multisine: "kind fs n_samples f_min f_max rms amplitude lines n_realizations rng",
    nlfrf.reduce_crest: "ms",
    nlfrf.record_from_samples: "u y fs n_samples lines r n_discard",
    nlfrf.load_record: "path u y r fs n_samples lines n_discard",
    nlfrf.io.save_record: "record path",
    nlfrf.identify: "record transient level_from n_detection",
    nlfrf.io.save_bla: "bla path",
    nlfrf.io.load_bla: "path",
    nlfrf.Bla.bound: "confidence of simultaneous",
    nlfrf.Bla.systematic: "",
    nlfrf.simulate: "rig ms n_periods n_discard oversampling hold executor progress",
    nlfrf.simulate_loop: "rig K r fs",
    nlfrf.paper_rig: "",
    robust.frd: "bla",
    robust.fit_nominal: "bla n_poles n_zeros delay dt stable",
    robust.uncertainty: "bla nominal form order confidence simultaneous even systematic below above",
    robust.validate: "model bla",
    robust.fit_weight: "omega radius order dt",
    robust.performance_weight: "omega_B M_S A order",
    robust.models.control_weight: "",
    robust.models.delay_weight: "",
    robust.shaping.loop_bounds: "model w_P",
    robust.mixsyn: "model w_P w_u",
    robust.ncfsyn: "G W1 W2 factor",
    robust.design_frf: "structure",
    robust.check: "model K w_P delay certify solver",
    robust.mu.mu_upper: "N blocks",
    robust.mu.mu_lower: "N blocks",
    robust.mu.certify_mu: "N_ss blocks level",
    robust.worst_case: "model K w_P",
    robust.io.save_model: "model path",
    robust.io.load_model: "path",
    robust.io.export_matlab: "path",
    robust.UncertaintyModel.sample: "n rng",
    robust.UncertaintyModel.contains: "",
}
FIELDS = {
    nlfrf.Multisine: "fs n_samples kind lines amplitude phase",
    nlfrf.signals.LineGrid: "excited odd even",
    nlfrf.Record: "u y fs lines r",
    nlfrf.Bla: "f G lines grid fs n_realizations n_periods transient level_source cov_noise cov_total cov_distortion "
    "cov_even dof grid_factor levels",
    nlfrf.bla.DistortionLevels: "f_excited f_odd f_even excited odd even noise_excited noise_odd noise_even",
    nlfrf.rig.Rig: "mass stiffness friction damping",
    nlfrf.rig.LoopResponse: "t r u x",
    friction.Coulomb: "",
    friction.Dahl: "",
    friction.LuGre: "sigma0 sigma1 sigma2 Fc Fs vs delta",
    friction.Leuven: "Fs Fc vs delta sigma1 sigma2 n curve",
    friction.GeneralizedMaxwellSlip: "",
    hysteresis.Linear: "K0",
    hysteresis.Tanh: "K0 Fy",
    hysteresis.Exponential: "",
    hysteresis.Parabola: "",
    hysteresis.ElasticPlastic: "",
    hysteresis.Table: "",
    hysteresis.MaxwellSlip: "stiffness strength",
    robust.models.NominalFit: "G delay omega response cost expected_cost residual",
    robust.UncertaintyModel: "nominal weight form omega radius confidence perturbation simultaneous radius_noise "
    "radius_odd radius_even radius_misfit radius_level",
    robust.models.Validation: "n_outside n_expected p_value omega_outside",
    robust.models.WeightFit: "W min_ratio max_excess_db mean_excess_db",
    robust.Design: "K gamma gamma_min",
    robust.RobustnessReport: "omega S T rs np_ rp nominally_stable robustly_stable robust_performance margin_rs "
    "margin_rp omega_rs omega_rp disk_margin certificates perturbation verdict reason advice",
    robust.mu.MuBound: "value scaling delta",
    robust.proofs.Certificate: "outcome level intervals reason",
    robust.analysis.WorstCase: "gain omega plant",
}
PROPERTIES = {
    nlfrf.Multisine: "f0 f u rms crest_factor",
    nlfrf.Bla: "omega var_noise var_total var_distortion var_even var_bound",
    robust.proofs.Certificate: "holds",
}


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.__qualname__)
def test_call(call):
    missing = set(CALLS[call].split()) - set(inspect.signature(call).parameters)
    assert not missing


@pytest.mark.parametrize("kind", FIELDS, ids=lambda kind: kind.__name__)
def test_fields(kind):
    assert not set(FIELDS[kind].split()) - set(field_names(kind))
    assert all(isinstance(getattr(kind, name), property) for name in PROPERTIES.get(kind, "").split())


def test_a_model_is_made_from_its_first_eight_fields():
    first = ("nominal", "weight", "form", "omega", "radius", "confidence", "perturbation", "simultaneous")
    assert field_names(robust.UncertaintyModel)[:8] == first
