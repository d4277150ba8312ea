"""The H-infinity norm, the frequencies where a gain crosses a level: closed forms, a dense grid."""

import control
import numpy as np
import pytest

from robust.lti.lti import response
from robust.lti.norms import crossings, hinf_norm, to_continuous, to_discrete
from tests.robust.proofs.search.test_bounded_real import random_system, second_order


@pytest.mark.parametrize("zeta", [0.5, 1e-2, 1e-6])
def test_norm_of_a_resonance_in_closed_form(zeta):
    system, norm = second_order(zeta)
    found, where = hinf_norm(system)
    assert found == pytest.approx(norm, rel=1e-9)
    assert where == pytest.approx(np.abs(system.poles()[0]) * np.sqrt(1 - 2 * zeta**2), rel=1e-6)


def test_norm_agrees_with_a_dense_grid():
    rng = np.random.default_rng(3)
    for n in (2, 4, 8):
        system = random_system(rng, n)
        omega = np.unique(
            np.concatenate(
                [
                    np.geomspace(1e-4, 1e4, 4000),
                    *[np.abs(p.imag) * np.linspace(0.99, 1.01, 400) for p in system.poles()],
                ]
            )
        )
        norm, where = hinf_norm(system)
        on_grid = np.abs(response(system, omega[omega > 0])).max()
        assert on_grid <= norm * (1 + 1e-9)
        assert (
            np.abs(response(system, np.array([where])))[0] == pytest.approx(norm, rel=1e-9) if np.isfinite(where) else 1
        )


def test_crossings_are_where_the_gain_crosses():
    system, _ = second_order(0.1)
    omega, _ = crossings((system.A, system.B, system.C, system.D), 2.0)
    assert np.abs(response(system, omega)) == pytest.approx(2.0, rel=1e-9)
    assert omega.size == 2


def test_the_bilinear_map_keeps_norms_and_comes_back():
    rng = np.random.default_rng(5)
    G = random_system(rng, 6)
    there = to_discrete(G.A, G.B, G.C, G.D)
    for m, again in zip((G.A, G.B, G.C, G.D), to_continuous(*there), strict=True):
        assert again == pytest.approx(m, rel=1e-7, abs=1e-9 * np.abs(m).max(initial=1e-9))
    assert hinf_norm(control.StateSpace(*there, 1.0))[0] == pytest.approx(hinf_norm(G)[0], rel=1e-7)
