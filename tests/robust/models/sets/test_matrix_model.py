"""Sets of plants of several inputs and outputs: what they hold, what breaks them, verdicts against
brute force.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import robust
from benchmarks.soundness_matrix import random_case, trial
from robust import UncertaintyModel
from robust.models.sets.records import JointProbability
from tests.support.printed import unwrapped

OMEGA = np.array([1.0, 3.0])


def number(x):
    return control.StateSpace([], [], [], [[x]])


def made(form, G, left, right, **more):
    radius = np.repeat(np.abs([w.D[0, 0] for w in (*left, *right)])[:, None], 2, axis=1)
    return UncertaintyModel(
        nominal=G,
        form=form,
        left=left,
        right=right,
        omega=OMEGA,
        radius=radius,
        confidence=0.95,
        **more,
    )


def axis_points(system):
    """Points of the stability boundary of a system."""
    if system.dt:
        return np.exp(1j * np.linspace(0.01, 3.1, 30))
    return 1j * np.geomspace(1e-3, 1e3, 30)


def plant(n=2):
    rng = np.random.default_rng(1)
    return control.StateSpace(
        -np.diag([1.0, 2, 3]), rng.normal(size=(3, n)), rng.normal(size=(n, 3)), np.zeros((n, n))
    )


def test_the_forms_are_what_they_say():
    """Each perturbed plant against its formula, at one frequency."""
    G, s = plant(), 0.7j
    H = G(s)
    left, right = (number(0.3), number(0.1)), (number(0.5), number(2.0))
    W_l, W_r = np.diag([0.3, 0.1]), np.diag([0.5, 2.0])
    Delta = np.array([[0.2, -0.4], [0.1, 0.6]])
    additive = made("additive", G, left, right).perturbed(Delta)(s)
    np.testing.assert_allclose(additive, H + W_l @ Delta @ W_r, rtol=1e-12)
    at_input = made("input", G, left, right).perturbed(Delta)(s)
    np.testing.assert_allclose(at_input, H @ (np.eye(2) + W_l @ Delta @ W_r), rtol=1e-12)
    weights = tuple(number(w) for w in (0.1, 0.2, 0.3, 0.4))
    entries = made("elements", G, (), weights).perturbed(np.diag([1.0, -0.5, 0.25, 1.0]))(s)
    np.testing.assert_allclose(entries, H + np.array([[0.1, 0.075], [-0.1, 0.4]]), rtol=1e-12)


@pytest.mark.parametrize(
    ("form", "n_y", "n_u"), [("additive", 2, 3), ("input", 2, 2), ("elements", 1, 2)]
)
def test_it_holds_what_is_at_most_one_away(form, n_y, n_u):
    """Plants far inside, far outside and beside the limit, where the Frobenius norm decides and
    where it does not.
    """
    rng = np.random.default_rng(0)
    left = () if form == "elements" else tuple(map(number, (0.3, 0.1)))
    G = control.StateSpace([], [], [], rng.normal(size=(n_y, n_u)))
    model = made(form, G, left, tuple(map(number, (0.5, 2.0, 1.0)[:n_u])))
    nominal = np.broadcast_to(G.D, (2, n_y, n_u))
    deviation = rng.normal(size=(500, 2, n_y, n_u)) + 1j * rng.normal(size=(500, 2, n_y, n_u))
    wanted = 3 * rng.random((500, 2))
    wanted[::2] = 1 + rng.choice([-1e-6, 1e-6], (250, 2))
    deviation *= (wanted / model.normalized_distance(OMEGA, nominal + deviation, nominal))[
        ..., None, None
    ]
    np.testing.assert_array_equal(model.is_within(OMEGA, nominal + deviation, nominal), wanted <= 1)


def test_conditions_of_the_full_blocks_are_those_of_the_book():
    """RS of additive: sigma(W_r K S W_l), of input: sigma(W_r T_i W_l); mimo of SP 8.6."""
    G, K, s = plant(), control.StateSpace([], [], [], np.array([[0.5, 0.2], [-0.1, 0.4]])), 0.7j
    left, right = (number(0.3), number(0.1)), (number(0.5), number(2.0))
    W_l, W_r, H, k = np.diag([0.3, 0.1]), np.diag([0.5, 2.0]), G(s), K.D
    S = np.linalg.inv(np.eye(2) + H @ k)
    found = made("additive", G, left, right).loop(K).loop(s)
    np.testing.assert_allclose(
        np.linalg.svd(found)[1], np.linalg.svd(W_r @ k @ S @ W_l)[1], rtol=1e-10
    )
    T_i = k @ H @ np.linalg.inv(np.eye(2) + k @ H)
    found = made("input", G, left, right).loop(K).loop(s)
    np.testing.assert_allclose(
        np.linalg.svd(found)[1], np.linalg.svd(W_r @ T_i @ W_l)[1], rtol=1e-10
    )


def test_performance_is_the_weighted_sensitivity():
    G, K = plant(), control.StateSpace([], [], [], 0.5 * np.eye(2))
    w_P = control.ss([[-0.1]], [[1.0]], [[0.05]], [[0.3]])
    system = made("additive", G, (number(0.1),) * 2, (number(0.1),) * 2).loop(K, w_P=w_P)
    s = 0.7j
    S = np.linalg.inv(np.eye(2) + G(s) @ K.D)
    np.testing.assert_allclose(system.N(s)[2:, 2:], w_P(s) * S, rtol=1e-10)
    assert system.with_performance == [(2, 2), (2, 2)]


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("seed", [*range(8), 189, 301])  # the last two break at Nyquist
def test_no_verdict_is_contradicted_by_brute_force(seed):
    report, worst, n_broken, breaks = trial(seed, 30)
    assert report.verdict in ("robust", "not robust", "not certified")
    assert not n_broken  # at 0.99 of the margin
    assert breaks  # at 1.01 of the perturbation that was found
    gains = np.linalg.svd(worst.Delta(axis_points(worst.Delta)).transpose(2, 0, 1))[1][:, 0]
    assert gains == pytest.approx(1, rel=1e-6)  # at all frequencies
    if worst.model.form != "elements":
        assert worst.size == pytest.approx(report.margins.rs, rel=0.01)
        assert (report.verdict == "robust") == (worst.size > 1)


def test_the_breaking_plant_replays():
    model, K, _ = random_case(1)
    worst = robust.analysis.breaking_perturbation(model, K)
    n = model.n_outputs
    for factor, stable in ((0.98, True), (1.02, False)):
        loop = (worst.plant(factor) * K).feedback(np.eye(n))
        p = loop.poles()
        boundary = 1 - np.abs(p).max() if loop.dt else -p.real.max()
        assert (boundary > 0) == stable


def stage_frm(noise=0.02, seed=1):
    ms = nlfrf.multisine(
        "random-odd", fs=100, n_samples=1000, f_min=0.1, f_max=30, n_inputs=2, rng=seed
    )
    A = control.StateSpace(
        [[0, 1, 0, 0], [-400, -4, 0, 0], [0, 0, 0, 1], [0, 0, -2500, -6]],
        [[0, 0], [400, 50], [0, 0], [100, 2500]], [[1, 0, 0.2, 0], [0.1, 0, 1, 0]], np.zeros((2, 2)),
    )  # fmt: skip
    G = robust.sampled(A, 0.01)
    H = np.moveaxis(G(np.exp(2j * np.pi * ms.f / 100)), 2, 0)
    spectrum = np.zeros((2, 2, 501), dtype=complex)
    spectrum[..., ms.lines.excited] = np.einsum("kji,iek->jek", H, ms.spectrum) * 500
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    y = np.repeat(np.fft.irfft(spectrum, 1000)[:, :, None], 2, axis=2)
    y = y + noise * np.random.default_rng(seed).standard_normal(y.shape)
    return nlfrf.identify(nlfrf.Record(u=u, y=y, fs=100, lines=ms.lines), transient="none"), G


@pytest.mark.attack
def test_the_nominal_of_a_scan_of_orders_has_the_stage_around_it():
    """The scan finds the four poles of the continuous plant near those of the stage."""
    frm, truth = stage_frm()
    nominal = robust.models.scan_orders([frm]).fit
    model = robust.uncertainty([frm], nominal, order=2, above="flat")
    assert model.form == "elements"
    away = model.normalized_distance(
        frm.omega,
        np.moveaxis(truth(np.exp(1j * frm.omega * 0.01)), 2, 0),
        np.moveaxis(model.at(frm.omega), 2, 0),
    )
    assert np.mean(away <= 1) > 0.9


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("form", ["elements", "additive", "input"])
def test_from_a_measured_matrix_to_a_verdict(form):
    frm, truth = stage_frm()
    fit = robust.fit_nominal(frm, n_poles=4, dt=0.01)
    model = robust.uncertainty(frm, fit, form=form, order=2, above="flat")
    # the truth lies in the set on nearly every line
    z = np.exp(1j * frm.omega * 0.01)
    apart = np.moveaxis(truth(z) - model.nominal(z), 2, 0)
    gains = np.array(
        [np.abs(w(z, squeeze=True)) * np.ones(z.size) for w in (*model.left, *model.right)]
    )
    if form == "elements":
        inside = np.all(np.abs(apart) < gains.reshape(2, 2, -1).transpose(2, 1, 0), axis=(1, 2))
    else:
        apart = (
            np.linalg.solve(np.moveaxis(model.nominal(z), 2, 0), apart)
            if form == "input"
            else apart
        )
        inside = (
            np.linalg.norm(apart / gains[:2].T[:, :, None] / gains[2:].T[:, None], 2, (1, 2)) < 1
        )
    assert inside.mean() > 0.95
    K = control.StateSpace([], [], [], 0.1 * np.eye(2), 0.01)
    report = robust.check(model, K)
    assert report.verdict == "statistically robust"
    assert report.margins.broken == pytest.approx(report.margins.rs, rel=0.02)
    assert form in unwrapped(model)
    hard = robust.check(model, control.StateSpace([], [], [], 1.2 * np.eye(2), 0.01))
    assert hard.verdict in ("not robust", "not certified")


@pytest.mark.attack
def test_two_forms_may_be_tried_for_their_price(tmp_path):
    """Both sets at (1 + p)/2, wider by the quantiles; the report is that of the better, at p, after
    a file as well.
    """
    frm, _ = stage_frm()
    fit = robust.fit_nominal(frm, n_poles=4, dt=0.01)
    options = {"order": 2, "above": "flat"}
    model = robust.uncertainty(frm, fit, form="auto", **options)
    assert (model.form, model.alternative_form.form) == ("elements", "additive")
    assert (model.confidence, model.alternative_form.confidence) == (0.975, 0.975)
    robust.save(model, tmp_path / "m.json")
    again = robust.load(tmp_path / "m.json")
    np.testing.assert_array_equal(again.alternative_form.radius, model.alternative_form.radius)
    assert str(again) == str(model)
    alone = {
        form: robust.uncertainty(frm, fit, form=form, **options)
        for form in ("elements", "additive")
    }
    wider = [
        one.radius[:2].mean() / alone[one.form].radius[:2].mean()
        for one in (model, model.alternative_form)
    ]
    assert all(1.02 < ratio < 1.2 for ratio in wider), wider
    # one channel of the controller alone: entries; all channels alike: the better of both,
    # whichever
    for gains in (np.diag([0.3, 0.0]), 0.3 * np.eye(2)):
        K = control.StateSpace([], [], [], gains, 0.01)
        report = robust.check(again, K)
        each = {
            one.form: robust.check(replace(one, alternative_form=None), K)
            for one in (model, model.alternative_form)
        }
        best = max(each, key=lambda form: each[form].margins.rs)
        assert report.margins.rs == pytest.approx(each[best].margins.rs, rel=1e-6)
        assert f"{best} gives most" in report.reason
        assert "with 95 % probability" in "; ".join(report.confidence)
    with pytest.raises(
        ValueError, match=r"alternative_form must have confidence 0\.975 as this set, got 0\.95"
    ):
        replace(model, alternative_form=alone["additive"])


def test_the_errors_of_two_forms_add_up():
    """Both sets hold the truth with at least 1 - 0.05 - 0.05, and all lines with 1 - 0.2 - 0.1."""
    G, w = plant(), (number(0.1),) * 2
    additive = replace(made("additive", G, w, w), joint=JointProbability(frf=0.9, bla=0.99))
    both = made("elements", G, (), w * 2, joint=JointProbability(frf=0.8, bla=0.99))
    said = " ".join(
        robust.check(replace(both, alternative_form=additive), 0.01 * np.eye(2)).confidence
    )
    assert "within the radius with 90 % probability" in said
    assert "a whole FRF lies under the weight with about 70 %" in said


def test_refusals():
    G, w = plant(), (number(0.1),) * 2
    with pytest.raises(
        ValueError,
        match="left and right must hold 0 and 4 weights for the elements form, got 2 and 2",
    ):
        made("elements", G, w, w)
    wide = control.StateSpace(G.A, G.B, G.C[:1], np.zeros((1, 2)))
    with pytest.raises(
        ValueError, match="form must be elements or additive for a plant that is not square"
    ):
        made("input", wide, w, w)
    model = made("additive", G, w, w)
    covered = np.array([[0.1, 0.1], [0.2, 0.2], [0.1, 0.1], [0.1, 0.1]])
    with pytest.raises(
        ValueError,
        match="K must have 2 inputs and 2 outputs, one for each output and input of the plant",
    ):
        robust.check(model, control.ss([], [], [], [[1.0]]))
    with pytest.raises(ValueError, match="model must have weights that fall above"):
        robust.check(
            model, control.StateSpace(-0.5 * np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)), 0.1)
        )
    with pytest.raises(
        ValueError, match=r"left\[1\] must cover its radius, .* got a ratio of 0\.5 at 1 rad"
    ):
        UncertaintyModel(
            nominal=G, form="additive", left=w, right=w, omega=OMEGA, radius=covered, confidence=0.95
        )  # fmt: skip
    with pytest.raises(ValueError, match="delay must be in the nominal for several channels"):
        robust.check(model, control.ss([], [], [], np.eye(2)), delay=0.1)
    with pytest.raises(ValueError, match="K must stabilise the nominal plant"):
        robust.analysis.breaking_perturbation(model, control.ss([], [], [], -100 * np.eye(2)))
    frm, _ = stage_frm()
    with pytest.raises(
        ValueError,
        match="form must be one of 'elements', 'additive', 'input', 'auto', got 'inverse-additive'",
    ):
        robust.uncertainty(frm, G, form="inverse-additive")
    with pytest.raises(ValueError, match="nominal must have 2 outputs and 2 inputs, as the record"):
        robust.uncertainty(frm, plant(3))
