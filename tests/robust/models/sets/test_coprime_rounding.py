"""Plants of the coprime form where rounding stands in the realisation: in the set, or refused."""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, ncfsyn, worst_case
from tests.support.responses import response

LINES = np.array([0.1, 1.0, 10.0])
#: A pole of 1e-16 in place of zero, as python-control realises an integrator; states that rounding
#: couples.
ROUNDED = (
    control.ss([[-1, 0], [-1, 1.1e-16]], [[-1], [0]], [[-1, -2]], [[0]]),
    control.ss([[-0.5, -1, 0], [1, 0, 0], [0, 1, -1.3e-17]], [[1], [0], [0]], [[1, 1, 1]], [[0]]),
    control.ss(
        [[-0.02, 0.00285, 2.4e-16], [-10, -9.7e-17, 2.6e-15], [0, -1, -5.6e-17]], [[1], [0], [0]],
        [[0.6, -0.68, 1.49]], [[0]],
    ),
)  # fmt: skip


def the_model(G, w):
    return UncertaintyModel(G, w, "coprime", LINES, np.full(3, 1e-6), perturbation="LTI")


def chordal(G, H):
    return np.abs(G - H) / np.sqrt((1 + np.abs(G) ** 2) * (1 + np.abs(H) ** 2))


@pytest.mark.parametrize("G", ROUNDED)
def test_rounding_in_the_realisation_leaves_the_plants_in_the_set(G):
    model, omega = the_model(G, 0.1), np.geomspace(1e-3, 1e3, 500)
    g = response(G, omega)
    away = [chordal(g, response(plant, omega)).max() for plant in model.sample(12, rng=0)]
    assert max(away) <= 0.1 * (1 + 1e-7)
    assert max(away) >= 0.1 * (1 - 1e-6)
    worst = worst_case(model, ncfsyn(G).K)
    assert chordal(g, response(worst.plant, omega)).max() <= 0.1 * (1 + 1e-7)
    assert worst.achieved == pytest.approx(worst.gain.max(), rel=2e-4)  # it is proved to 1e-4


def test_an_all_pass_perturbation_goes_to_the_rim_at_every_frequency():
    """The factors and their complement are all-pass together; hidden modes cost nothing."""
    rng = np.random.default_rng(4)
    hides = control.ss(np.diag([-1.0, -3.0, 0.5]), [[1], [0], [1]], [[1, 1, 1]], [[0.2]])
    for G in (*ROUNDED, hides, control.ss([], [], [], [[2.0]])):
        model, omega = the_model(G, 0.1), 10 ** rng.uniform(-3, 3, 20)
        g = response(G, omega)
        for sign in (-1.0, 1.0):
            plant = model.perturbed(sign)
            assert chordal(g, response(plant, omega)) == pytest.approx(0.1, rel=1e-11)


def test_what_rounding_spoils_is_not_returned(monkeypatch):
    """Factors of another plant, and a plant outside of the set, are told as what they are."""
    slow_and_fast = np.polymul([1, -1e-5], np.polymul([1, 1e5], [1, 2e5]))
    with pytest.raises(
        ValueError, match="nominal must have coprime factors that can be computed accurately"
    ):
        the_model(control.ss(control.tf([1e3], slow_and_fast)), 0.1).sample(1, rng=0)
    G = ROUNDED[0]
    monkeypatch.setattr(
        "robust.analysis.worst_plant.perturbed_plant", lambda form, G, *rest: 1.5 * G
    )
    with pytest.raises(
        ValueError,
        match="worst plant that floating point can represent, got a plant that rounding moves",
    ):
        worst_case(the_model(G, 0.1), ncfsyn(G).K)
