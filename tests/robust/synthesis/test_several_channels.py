"""Names of channels go through: from the record to the model, to the controller and what it
sees.
"""

import control
import numpy as np
import pytest

import nlfrf
import robust

INPUTS, OUTPUTS = ("fx", "fy"), ("x", "y")
WEAK = 0.02


@pytest.fixture(scope="module")
def model():
    ms = nlfrf.multisine(
        "random-odd", fs=256, n_samples=1024, f_min=0.5, f_max=60, n_inputs=2, rng=2
    )
    s = 2j * np.pi * np.fft.rfftfreq(1024, 1 / 256)
    G = np.array([[5 / (s / 10 + 1), 1 / (s / 20 + 1)], [0.5 / (s / 20 + 1), 3 / (s / 8 + 1)]])
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    y = np.fft.irfft(np.einsum("ijk,jmpk->impk", G, np.fft.rfft(u)), 1024)
    y += 0.01 * u**3 + 1e-3 * np.random.default_rng(0).standard_normal(y.shape)
    record = nlfrf.Record(u=u, y=y, fs=256, lines=ms.lines, inputs=INPUTS, outputs=OUTPUTS)
    bla = nlfrf.identify(record)
    assert (bla.inputs, bla.outputs) == (INPUTS, OUTPUTS)
    return robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=4))


def test_a_model_and_what_a_sampled_controller_sees_keep_the_names_of_the_record(model):
    for G in (
        model.nominal,
        robust.sampled(model.nominal, 1e-3),
        robust.sampled(model.nominal, 1e-3, 1.5e-3),
    ):
        assert (tuple(G.input_labels), tuple(G.output_labels)) == (INPUTS, OUTPUTS)
    assert (model.inputs, model.outputs) == (INPUTS, OUTPUTS)
    assert robust.margins.disk_margins(model.nominal, 0.1 * np.eye(2)).input_names == INPUTS


@pytest.mark.parametrize(
    "design", [lambda G: robust.ncfsyn(G).K, lambda G: robust.mixsyn(G, 0.5).K]
)
def test_a_controller_runs_from_the_outputs_of_its_plant_to_its_inputs(model, design):
    K = design(model.nominal)
    for one in (K, robust.lti.discretize(K, 1e-3)):
        assert (tuple(one.input_labels), tuple(one.output_labels)) == (OUTPUTS, INPUTS)


def test_a_model_made_by_hand_takes_the_names_of_its_nominal():
    G = control.ss(
        -np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)), inputs=INPUTS, outputs=OUTPUTS
    )
    w, omega = control.ss([], [], [], [[0.2]]), np.array([1.0, 2.0])
    weights = {"left": (w, w), "right": (w, w), "radius": np.full((4, 2), 0.2)}
    made = robust.UncertaintyModel(
        nominal=G, form="additive", omega=omega, confidence=0.95, **weights
    )
    assert (made.inputs, made.outputs) == (INPUTS, OUTPUTS)


def test_a_continuous_demand_stands_over_a_sampled_loop(model):
    """The verdict is that of the demand on the lines: largest |w_P S_p| over frequency, found by
    closing the loop.
    """
    dt = 1 / 256
    sampled = robust.UncertaintyModel(
        nominal=robust.sampled(model.nominal, dt),
        form="additive",
        confidence=0.95,
        omega=model.omega[:2],
        left=(control.ss([], [], [], [[1e-6]], dt),) * 2,
        right=(control.ss([], [], [], [[1.0]], dt),) * 2,
        radius=np.full((4, 2), 1e-7),
    )
    K = control.ss([[1.0, 0.0], [0.0, 1.0]], 0.02 * np.eye(2), np.eye(2), 0.1 * np.eye(2), dt)
    w_P = robust.performance_weight(3.0, M_S=1.5)
    report = robust.check(sampled, K, w_P=w_P)
    omega = np.geomspace(1e-3, np.pi / dt, 4000)
    L = np.moveaxis((sampled.nominal * K)(np.exp(1j * omega * dt)), 2, 0)
    S = np.linalg.norm(np.linalg.inv(np.eye(2) + L), 2, axis=(1, 2)) * np.abs(w_P(1j * omega))
    assert report.curves.rp.max() == pytest.approx(S.max(), rel=0.01)


@pytest.mark.attack
def test_a_controller_of_several_channels_is_reduced_to_what_was_proved(model):
    """States that the loop hardly sees go, and the verdict stays; the names stay with the
    controller.
    """
    K = robust.ncfsyn(model.nominal, WEAK).K
    fast = control.ss(-1e4 * np.eye(2), np.eye(2), 1e4 * np.diag([1e-5, 2e-5]), np.zeros((2, 2)))
    larger = K + fast
    larger.update_names(inputs=OUTPUTS, outputs=INPUTS)
    before = robust.check(model, larger)
    assert before.verdict.is_robust
    found = robust.reduce_controller(larger, model)
    assert found.kept
    assert found.order <= K.nstates
    assert found.report.verdict == before.verdict
    assert tuple(found.K.input_labels) == OUTPUTS
    with pytest.raises(ValueError, match="order must be below the"):
        robust.reduce_controller(larger, model, order=larger.nstates)


def test_what_takes_one_loop_names_what_several_channels_take(model):
    w = robust.performance_weight(1.0)
    for call, cure in (
        (
            lambda: robust.synthesis.feedforward_filter(model, 0.1 * np.eye(2), w),
            "use prefilter, or dk_iteration or hinfsyn with",
        ),
        (lambda: robust.shaping.loop_bounds(model, w), "use loop_gains for its singular values"),
        (
            lambda: robust.analysis.predict_level(
                model, 0.1, robust.analysis.LoopSignals(reference=robust.analysis.StepSignal(1.0))
            ),
            "simulate its loop",
        ),
    ):
        with pytest.raises(
            ValueError, match=f"model must have one input and one output .*, got 2 x 2: .*{cure}"
        ):
            call()
