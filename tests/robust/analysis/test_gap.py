"""The nu-gap and the margin it eats: closed forms, published numbers, brute force."""

import control
import numpy as np
import pytest

import robust
from robust import ncfsyn, sampled
from tests.support.responses import response

BOOK = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))


def stable(G, K):
    p = control.feedback(G * K, 1).poles()
    return np.all(np.abs(p) < 1) if K.dt else np.all(p.real < 0)


def test_nu_gap_does_not_depend_on_the_scale_of_the_states():
    """Slow unstable poles of a sampled plant, its input gain in C: chordal distance on a grid."""
    poles = np.array([1.00413 + 0.0179j, 1.00413 - 0.0179j, 1.0027, 1.0016])
    plants = []
    for factor in (1.0, 0.9984):
        A = np.zeros((4, 4))
        A[0], A[1:, :-1] = -np.poly(poles * factor).real[1:], np.eye(3)
        C = 3e-9 * np.array([[0.0, 1.0, -0.45, 0.0]])
        plants.append(control.StateSpace(A, np.eye(4)[:, :1], C, [[0.0]], 0.01))
    omega = np.geomspace(1e-4, 0.999 * np.pi / 0.01, 20_000)
    first, second = (response(G, omega) for G in plants)
    chord = np.abs(first - second) / np.sqrt((1 + np.abs(first) ** 2) * (1 + np.abs(second) ** 2))
    gap = robust.margins.nu_gap(*plants)
    assert gap == pytest.approx(chord.max(), rel=1e-3)
    for size in (1e-6, 1e6):
        scaled = [control.StateSpace(G.A, G.B * size, G.C / size, G.D, G.dt) for G in plants]
        assert robust.margins.nu_gap(*scaled) == pytest.approx(gap, rel=1e-6)


def test_nu_gap_closed_forms():
    """Zhou & Doyle, Essentials of Robust Control, 17.2:

    0.02, 0.8988, 0.8941; two gains: their chordal distance.
    """
    a, b, c = control.tf([100], [2, 1]), control.tf([100], [2, -1]), control.tf([100], [1, 2, 1])
    assert robust.margins.nu_gap(a, b) == pytest.approx(0.02, abs=5e-5)
    assert robust.margins.nu_gap(a, c) == pytest.approx(0.8988, abs=5e-5)
    assert robust.margins.nu_gap(b, c) == pytest.approx(0.8941, abs=5e-5)
    assert robust.margins.nu_gap(1.0, 2.0) == pytest.approx(1 / np.sqrt(10))
    assert robust.margins.nu_gap(c, c) < 1e-12
    assert (
        robust.margins.nu_gap(control.tf([1], [1, -1]), control.tf([-1], [1, -1])) == 1.0
    )  # no winding: as far as can be


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_gap_and_margin_hold_each_other(dt):
    """Vinnicombe: arcsin b(G2, K) >= arcsin b(G1, K) - arcsin gap, and a loop with b > gap stays
    stable.
    """
    rng = np.random.default_rng(0)
    for _ in range(8):
        G1 = control.ss(
            control.tf(rng.uniform(0.5, 3, 1), [1, rng.uniform(-0.5, 2), rng.uniform(0.2, 2)])
        )
        G2 = control.ss(
            control.tf(rng.uniform(0.5, 3, 1), [1, rng.uniform(-0.5, 2), rng.uniform(0.2, 2)])
        )
        if dt:
            G1, G2 = sampled(G1, dt), sampled(G2, dt)
        K = ncfsyn(G1).K
        gap, b1, b2 = (
            robust.margins.nu_gap(G1, G2),
            robust.margins.ncf_margin(G1, K),
            robust.margins.ncf_margin(G2, K),
        )
        assert gap == pytest.approx(robust.margins.nu_gap(G2, G1), abs=1e-6)
        assert np.arcsin(b2) >= np.arcsin(b1) - np.arcsin(gap) - 1e-6
        assert stable(G2, K) or gap >= b1
        assert ncfsyn(G1).gamma == pytest.approx(1 / b1, rel=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: robust.margins.nu_gap(sampled(control.ss(BOOK), 0.1), BOOK),
            "G2 must have the sampling time of G1",
        ),
        (
            lambda: robust.margins.ncf_margin(
                sampled(control.ss(BOOK), 0.1), control.tf([1], [1, 1])
            ),
            "K must have the sampling time",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
