"""Sets of several channels from weights of the user, and interconnections: the call that works is
in each refusal.
"""

import control
import numpy as np
import pytest

import robust
from robust import UncertaintyModel, check, dk_iteration
from robust.models import Block, interconnection

G = control.ss(-np.eye(2), np.eye(2), [[1.0, 0.3], [0.2, 1.0]], np.zeros((2, 2)))
OMEGA = np.logspace(-2, 2)
SCALES = {
    "input": "left=(w,) * 2, right=(1,) * 2",
    "additive": "left=(w,) * 2, right=(1,) * 2",
    "elements": "left=(), right=(w,) * 4",
}


@pytest.mark.parametrize("form", SCALES)
def test_the_call_that_a_refusal_names_makes_the_set(form):
    with pytest.raises(
        ValueError, match="left and right must be the weights for a plant with 2 outputs by 2"
    ) as stop:
        UncertaintyModel(G, 0.2, form)
    call = str(stop.value).rpartition(": ")[2]
    assert SCALES[form] in call
    model = eval(call, {"UncertaintyModel": UncertaintyModel, "G": G, "w": 0.2, "omega": OMEGA})
    assert model.form == form
    np.testing.assert_array_equal(model.radius[:, 0], [w.D[0, 0] for w in model.weights])
    with pytest.raises(ValueError, match=r"bla must be an nlfrf\.Bla .*UncertaintyModel\(\.\.\.\)"):
        robust.uncertainty([0.2, 0.2], G, form=form)


def test_a_plant_that_is_not_square_is_sent_to_the_additive_form():
    with pytest.raises(ValueError, match=r"form='additive', left=\(w,\) \* 2, right=\(1,\) \* 1"):
        UncertaintyModel(G[:, 0], 0.2, "multiplicative")


def test_twenty_per_cent_an_input_by_hand():
    """With all inputs perturbed together mu is 0.2 times the largest singular value of T at the
    input.
    """
    model = UncertaintyModel(
        G, form="input", left=(0.2, 0.2), right=(1, 1), omega=OMEGA, perturbation="LTI"
    )
    K = control.ss([], [], [], 3 * np.eye(2))
    D = np.array([[1.0, 0.3], [0.2, 1.0]])
    T = 3 * D @ np.linalg.inv(np.eye(2) + 3 * D)  # at zero frequency, where it is largest
    report = check(model, K)
    assert report.verdict == "robust"
    assert 1 / report.margins.rs == pytest.approx(0.2 * np.linalg.norm(T, 2), rel=1e-3)


def lag_with_block(*more, **of):
    lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]], inputs="u", outputs="y")
    return interconnection([lag, *more], {"gain": Block("u", "u", 0.5)}, **of)


def test_the_signals_of_an_interconnection_keep_their_names():
    K = control.ss([], [], [], [[-4.0]], inputs="y", outputs="u")
    system = lag_with_block(K, inputs="u", outputs="y")
    assert (system.N.input_labels, system.N.output_labels) == (["gain:u", "u"], ["gain:u", "y"])
    assert (system.loop.input_labels, system.loop.output_labels) == (["gain:u"], ["gain:u"])
    assert control.ss([], [], [], [[1.0]]).lft(system.N).poles() == pytest.approx(
        [-7.0]
    )  # s + 1 + 4 (1 + 0.5)


def test_an_open_loop_is_designed_for_and_takes_the_part_that_its_refusal_names():
    with pytest.raises(ValueError, match="got 'u', which no system drives: add") as stop:
        lag_with_block(inputs="u", outputs="y")
    part = str(stop.value).partition("add ")[2].partition(" to the systems")[0]
    through = eval(part, {"control": control})
    minus = control.ss([], [], [], [[-1.0]], inputs="y", outputs="e")
    weight = control.ss([], [], [], [[0.4]], inputs="y", outputs="z")
    lag = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["u", "d"], outputs="y")
    system = interconnection(
        [lag, through, minus, weight],
        {"gain": Block("u", "u", 0.5)},
        inputs=["d", "u_in"],
        outputs=["z", "e"],
    )
    found = dk_iteration(system, n_y=1, n_u=1, n_rounds=1)
    by_hand = dk_iteration(system.N, [(1, 1), (1, 1)], 1, 1, n_rounds=1)
    assert found.mu == by_hand.mu < 1
    with pytest.raises(
        ValueError, match="n_y and n_u must be the number of last outputs, of z, e, that K reads"
    ):
        dk_iteration(system)
    with pytest.raises(ValueError, match="blocks must be left out for an interconnection"):
        dk_iteration(system, [(1, 1)], 1, 1)


def test_what_takes_no_interconnection_names_what_does(tmp_path):
    system = lag_with_block(control.ss([], [], [], [[-4.0]], inputs="y", outputs="u"))
    for call in (
        lambda: check(system, 1.0),
        lambda: robust.worst_case(system, 1.0),
        lambda: robust.reports.write_report(tmp_path / "r.html", system, 1.0),
    ):
        with pytest.raises(
            ValueError, match=r"got an UncertainSystem: use check_structure\(system\)"
        ):
            call()
    assert robust.analysis.check_structure(system).margins.worst is not None
