"""Designs unpack as in MATLAB and python-control, and CL is the closed loop whose norm gamma is."""

import control
import numpy as np
import pytest

import robust

G = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))  # SP Example 2.17
OMEGA = np.geomspace(1e-3, 1e3, 600)


def largest_gain(system):
    """The largest singular value over a grid, by python-control alone."""
    H = np.moveaxis(system(1j * OMEGA), 2, 0)
    return np.linalg.svd(H, compute_uv=False).max()


def test_mixsyn_takes_the_weights_in_the_order_of_python_control():
    w_P = robust.performance_weight(10, M_S=1.5, A=1e-4)
    K, CL, gamma, info = robust.mixsyn(G, w_P, 1, 0.1)
    assert info.K is K
    assert gamma == pytest.approx(info.gamma, nan_ok=True)
    assert gamma == robust.mixsyn(G, w_P, w_u=1, w_T=0.1).gamma
    assert CL.noutputs == 3
    assert CL.ninputs == 1
    s = 1j * OMEGA
    L = G(s) * K(s)
    curves = np.array([w_P(s) / (1 + L), K(s) / (1 + L), 0.1 * L / (1 + L)])
    assert np.abs(CL(s)[:, 0]) == pytest.approx(np.abs(curves), rel=1e-6, abs=1e-9)
    assert largest_gain(CL) == pytest.approx(gamma, rel=1e-3)


def test_ncfsyn_gives_the_loop_of_the_shaped_plant():
    W1 = control.tf([1, 2], [1, 0])
    K, CL, gamma, info = robust.ncfsyn(G, W1)
    assert (info.K, info.CL, info.gamma) == (K, CL, gamma)
    assert (CL.noutputs, CL.ninputs) == (2, 2)
    assert largest_gain(CL) == pytest.approx(gamma, rel=1e-3)


def test_hinfsyn_and_dk_iteration_give_the_loop_that_they_closed():
    A, B, C = [[-1.0]], [[1.0, 0.0, 1.0]], [[0.0], [-0.5], [-1.0]]
    P = control.ss(A, B, C, [[0, 0, 0.5], [0, 0.5, 0], [0, 1, 0]])
    K, CL, gamma, info = robust.hinfsyn(P, 1, 1)
    assert info.K is K
    assert gamma == info.gamma
    assert largest_gain(CL) <= gamma * (1 + 1e-6)
    K, CL, mu, info = robust.dk_iteration(P, [(1, 1), (1, 1)], 1, 1, n_rounds=1)
    N = CL(1j * info.omega)
    assert robust.mu.upper(N, [(1, 1), (1, 1)]).value.max() == pytest.approx(mu, rel=1e-6)


def test_a_design_on_the_lines_of_an_frf_has_no_closed_loop_in_states():
    K, CL, gamma, info = robust.design_frf(G, "PI", M_S=1.7, omega_c=1.0)
    assert CL is None
    assert info.met
    assert info.K is K
    assert gamma == pytest.approx(info.gamma, nan_ok=True)
