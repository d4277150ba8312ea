"""The nu-gap and the coprime margin of several inputs and outputs: definitions, invariances, what
they promise.
"""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robust
from robust import UncertaintyModel, ncfsyn, sampled
from tests.support.responses import response_by_channel

OMEGA = np.geomspace(1e-3, 1e4, 3000)


def plant(rng, n, n_y, n_u, *, push=0.5, gain=1.0):
    A = rng.standard_normal((n, n)) - push * np.eye(n)
    return control.StateSpace(
        A,
        rng.standard_normal((n, n_u)),
        gain * rng.standard_normal((n_y, n)),
        np.zeros((n_y, n_u)),
        0,
    )


def along(G, omega):
    return np.moveaxis(response_by_channel(G, omega), 2, 0)


def chord(g1, g2):
    """Largest singular value of (1 + G2 G2*)^-1/2 (G1 - G2) (1 + G1* G1)^-1/2, line by line."""
    left = inverse_root(g2 @ np.swapaxes(g2, 1, 2).conj())
    right = inverse_root(np.swapaxes(g1, 1, 2).conj() @ g1)
    return np.linalg.norm(left @ (g1 - g2) @ right, 2, axis=(1, 2))


def inverse_root(X):
    values, vectors = np.linalg.eigh(X)
    return vectors / np.sqrt(1 + values)[:, None] @ np.swapaxes(vectors, 1, 2).conj()


def winds(G1, G2, omega):
    """wno det(1 + G2~ G1) + eta(G1) - eta(G2): zero where the winding condition holds (no poles on
    the axis).
    """
    g1, g2 = along(G1, omega), along(G2, omega)
    det = np.linalg.det(np.eye(g1.shape[2]) + np.swapaxes(g2, 1, 2).conj() @ g1)
    det = np.concatenate([det[::-1].conj(), det])
    turns = np.sum(np.angle(det[1:] / det[:-1])) / (
        2 * np.pi
    )  # up the axis; closed at infinity, where it is one
    unstable = [int(np.sum(G.poles().real > 0)) for G in (G1, G2)]
    # up the axis is clockwise about the right half plane: zeros less poles there, -turns, and G2~
    # has n - eta(G2)
    return round(-turns) + unstable[0] - unstable[1]


def test_by_the_definition():
    """Chordal distance and winding number on a grid, neither by factors: plants near and far,
    stable and not.
    """
    rng = np.random.default_rng(0)
    seen = set()
    for trial in range(24):
        n_y, n_u = rng.integers(1, 4, 2)
        G1 = plant(rng, 3, n_y, n_u, gain=3.0)
        if trial % 2:
            G2 = control.StateSpace(G1.A + 0.3 * rng.standard_normal((3, 3)), G1.B, G1.C, G1.D, 0)
        else:
            G2 = plant(rng, 3, n_y, n_u, gain=3.0)
        gap = robust.margins.nu_gap(G1, G2)
        if winds(G1, G2, OMEGA) != 0:
            assert gap == 1.0
            seen.add("far")
        else:
            assert gap == pytest.approx(chord(along(G1, OMEGA), along(G2, OMEGA)).max(), abs=2e-3)
            seen.add("near" if gap < 0.9 else "apart")
    assert seen == {"far", "near", "apart"}


def test_beside_one_another():
    """Plants side by side: the largest of the single gaps, one where any winding fails; the least
    of the margins.
    """
    one = [control.ss(control.tf([1], [1, a])) for a in (1.0, 1.5, -0.2, 3.0)]
    two = [control.ss(control.tf([1.3], [1, a])) for a in (1.2, 1.1, -0.1, 2.0)]
    single = [robust.margins.nu_gap(a, b) for a, b in zip(one, two, strict=True)]
    assert robust.margins.nu_gap(control.append(*one), control.append(*two)) == pytest.approx(
        max(single), rel=1e-9
    )
    opposite = control.append(*two[:3], -control.ss(control.tf([1], [1, -3])))
    assert (
        robust.margins.nu_gap(control.append(*one), opposite)
        == robust.margins.nu_gap(one[3], -control.ss(control.tf([1], [1, -3])))
        == 1.0
    )
    K = [control.ss(control.tf([k, 1], [0.1, 1])) for k in (1, 2, 3, 4)]
    wanted = min(robust.margins.ncf_margin(G, k) for G, k in zip(one, K, strict=True))
    assert robust.margins.ncf_margin(control.append(*one), control.append(*K)) == pytest.approx(
        wanted, rel=1e-9
    )


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), dt=st.sampled_from([0.0, 0.1]))
def test_invariances(seed, dt):
    """The same seen in turned or exchanged channels, from the other plant, and transposed."""
    rng = np.random.default_rng(seed)
    G1, G2 = plant(rng, 3, 2, 3), plant(rng, 3, 2, 3)
    G2 = control.StateSpace(G1.A, G1.B, G1.C + 0.4 * G2.C, G1.D, 0)
    if dt:
        G1, G2 = sampled(G1, dt), sampled(G2, dt)
    gap = robust.margins.nu_gap(G1, G2)
    Q_y, Q_u = np.linalg.qr(rng.standard_normal((2, 2)))[0], np.eye(3)[rng.permutation(3)]

    def turned(G):
        return control.StateSpace(G.A, G.B @ Q_u, Q_y @ G.C, Q_y @ G.D @ Q_u, G.dt)

    def dual(G):
        return control.StateSpace(G.A.T, G.C.T, G.B.T, G.D.T, G.dt)

    assert robust.margins.nu_gap(turned(G1), turned(G2)) == pytest.approx(gap, rel=1e-6)
    assert robust.margins.nu_gap(G2, G1) == pytest.approx(gap, rel=1e-6)
    assert robust.margins.nu_gap(dual(G1), dual(G2)) == pytest.approx(gap, rel=1e-6)
    assert robust.margins.nu_gap(G1, turned(turned(G1))) <= 1.0
    K = ncfsyn(G1).K
    turned_K = control.StateSpace(K.A, K.B @ Q_y.T, Q_u.T @ K.C, Q_u.T @ K.D @ Q_y.T, K.dt)
    assert robust.margins.ncf_margin(turned(G1), turned_K) == pytest.approx(
        robust.margins.ncf_margin(G1, K), rel=1e-6
    )


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_gap_and_margin_hold_each_other(dt):
    """Vinnicombe: arcsin b(G2, K) >= arcsin b(G1, K) - arcsin gap, and a loop with b > gap stays
    stable.
    """
    rng = np.random.default_rng(1)
    kept = 0
    for _ in range(8):
        G1 = plant(rng, 3, 2, 2)
        G2 = control.StateSpace(G1.A + 0.05 * rng.standard_normal((3, 3)), G1.B, G1.C, G1.D, 0)
        if dt:
            G1, G2 = sampled(G1, dt), sampled(G2, dt)
        K = ncfsyn(G1).K
        gap, b1, b2 = (
            robust.margins.nu_gap(G1, G2),
            robust.margins.ncf_margin(G1, K),
            robust.margins.ncf_margin(G2, K),
        )
        kept += gap < b1
        assert np.arcsin(b2) >= np.arcsin(b1) - np.arcsin(gap) - 1e-6
        assert b2 > 0 or gap >= b1
    assert kept >= 6


def test_margin_by_its_definition():
    rng = np.random.default_rng(2)
    G = plant(rng, 3, 2, 3)
    K = ncfsyn(G).K
    g, k = along(G, OMEGA), along(K, OMEGA)
    S = np.linalg.inv(np.eye(2) + g @ k)
    four = (
        np.concatenate([k, np.broadcast_to(np.eye(2), S.shape)], 1)
        @ S
        @ np.concatenate([np.broadcast_to(np.eye(2), S.shape), g], 2)
    )
    assert 1 / robust.margins.ncf_margin(G, K) == pytest.approx(
        np.linalg.norm(four, 2, axis=(1, 2)).max(), rel=1e-4
    )
    static = np.array([[1.0, 2.0], [0.0, 1.0]])
    assert robust.margins.ncf_margin(static, np.zeros((2, 2))) == pytest.approx(
        1 / np.sqrt(1 + np.linalg.norm(static, 2) ** 2)
    )


def test_of_a_measured_set_its_nominal_counts():
    rng = np.random.default_rng(3)
    G = plant(rng, 2, 2, 2, push=4.0)
    w = control.StateSpace([], [], [], [[0.1]])
    model = UncertaintyModel(
        nominal=G, form="additive", left=(w, w), right=(w, w), omega=np.array([1.0]), radius=np.full((4, 1), 0.1),
        confidence=0.95,
    )  # fmt: skip
    assert robust.margins.nu_gap(model, G) < 1e-9
    assert robust.margins.ncf_margin(model, np.eye(2)) == robust.margins.ncf_margin(G, np.eye(2))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: robust.margins.nu_gap(np.eye(2), np.ones((2, 3))),
            "G2 must have 2 outputs and 2 inputs, as G1, got 2 and 3",
        ),
        (
            lambda: robust.margins.ncf_margin(np.ones((2, 3)), np.eye(2)),
            "K must have 2 inputs and 3 outputs",
        ),
        (lambda: robust.margins.ncf_margin(np.eye(2), 1.0), "K must have 2 inputs and 2 outputs"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_gap_that_is_nearly_reached_at_the_nyquist_frequency_is_that_of_its_peak():
    """The norm starts from there, and finds what is a little higher: never less than line by
    line.
    """
    omega = np.linspace(0, np.pi, 300)
    for seed in (*range(40, 60), 81, 120, 191, 213):
        rng = np.random.default_rng(seed)
        n, n_u = rng.integers(1, 5), rng.integers(1, 4)
        A = rng.standard_normal((n, n))
        A *= rng.uniform(0.3, 1.1) / np.abs(np.linalg.eigvals(A)).max()
        B = rng.standard_normal((n, n_u))
        C = rng.standard_normal((2, n))
        D = rng.standard_normal((2, n_u))
        first = control.StateSpace(A, B, C, D, 1.0)
        moved = A + 0.1 * rng.standard_normal((n, n))
        second = control.StateSpace(moved, B, C + 0.2 * rng.standard_normal((2, n)), D, 1.0)
        g1, g2 = along(first, omega), along(second, omega)
        assert robust.margins.nu_gap(first, second) >= chord(g1, g2).max() - 1e-9
