"""Bristles that creep: the inequality along motions of LuGre, the certificate, and where passivity
alone decides.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from robust import friction_plant, prove_friction
from robust.friction import Bristle
from tests.support.friction_loops import RIG, T, pd, pid, rest_of, sliding_loop

NODES, GAUSS = np.polynomial.legendre.leggauss(12)
RIG_FRICTION = Bristle(64e3, 1 / 0.7, 13.0)


def pieces_of_lugre(k, Fc, Fs, a, rng, n=60):
    """Per piece of constant velocity: v, length, and at its nodes the force F of the bristle and
    its filter Fh.
    """
    F = Fh = 0.0
    for _ in range(n):
        v, span = rng.normal() * 5 * rng.choice([0.0, 1.0], p=[0.1, 0.9]), 0.05 * rng.exponential()
        g = rng.uniform(Fc, Fs)  # the Stribeck curve may be anything in between
        t = np.append(span * (NODES + 1) / 2, span)
        rate = k * abs(v) / g  # F' = k v - rate F
        goal = np.sign(v) * g
        decay = np.exp(-rate * t)
        force = goal + (F - goal) * decay if v else np.full(t.size, F)
        lag = np.exp(-a * t)
        near = t * lag if np.isclose(rate, a, rtol=1e-6) else (decay - lag) / (a - rate)
        filtered = goal + (Fh - goal) * lag + a * (F - goal) * near if v else F + (Fh - F) * lag
        yield v, span, force[:-1], filtered[:-1], v - (abs(v) * force[:-1] / g if v else 0.0)
        F, Fh = force[-1], filtered[-1]


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    rho=st.floats(1.0, 3.0),
    a=st.floats(0.5, 50.0),
    seed=st.integers(0, 2**32 - 1),
    spare=st.floats(1.0, 2.0),
)
def test_no_bristle_gives_back_more_than_it_stored(rho, a, seed, spare):
    """Both integrals of the class, along LuGre whose Stribeck curve jumps about in [Fc, Fs], from
    rest.
    """
    rng = np.random.default_rng(seed)
    k, Fc = 10 ** rng.uniform(-1, 1, 2)
    totals, least, size = np.zeros(2), np.zeros(2), 1e-300
    for v, span, F, Fh, q in pieces_of_lugre(k, Fc, rho * Fc, a, rng):
        e = Fh - F
        parts = span / 2 * np.array([GAUSS @ (F * v), GAUSS @ (-e * q - a / (spare * k) * e**2)])
        assert (q - (1 - rho) * v).min() * np.sign(v) >= -1e-9 * abs(v)
        assert (q - (1 + rho) * v).max() * np.sign(v) <= 1e-9 * abs(v)
        totals += parts
        least, size = np.minimum(least, totals), max(size, np.abs(parts).max())
    assert (least >= -1e-9 * size * 60).all()


def test_the_inequality_notices_a_bristle_that_is_stiffer():
    """A bristle ten times as stiff as is said gives back more."""
    rng, a, broken = np.random.default_rng(0), 20.0, 0
    for _ in range(20):
        total = least = 0.0
        for _, span, F, Fh, q in pieces_of_lugre(1.0, 1.0, 1.2, a, rng):
            total += span / 2 * (GAUSS @ (-(Fh - F) * q - a / 0.1 * (Fh - F) ** 2))
            least = min(least, total)
        broken += least < -1e-3
    assert broken == 20


@pytest.mark.parametrize("rho", [1.0, 1 / 0.7, 3.0])
def test_the_block_of_a_proof_is_nowhere_negative(rho):
    """The form in (v, q, gamma) wherever q and gamma can be, by a grid over the sector."""
    proof = prove_friction(
        friction_plant(1.0, 80e3, 60.0), pd(20e3, 60.0), Bristle(64e3, rho, 13.0)
    )
    (port,) = proof.certificate.claim.ports
    t, s = np.linspace(1 - rho, 1 + rho, 41)[:, None], np.linspace(0, 1, 21)
    y = np.stack(np.broadcast_arrays(np.ones_like(t), t, s * t), axis=-1)
    assert np.einsum("...i,ij,...j", y, port.block, y).min() >= 0


@pytest.mark.parametrize(("c", "verdict"), [(5.8, "proved"), (5.5, "not decided")])
def test_where_the_microdamping_must_be_outweighed(c, verdict):
    """z' = (1 - rho) v at its worst: only a viscous friction above sigma1 (rho - 1) = 5.571 Ns/m
    outweighs it.
    """
    assert prove_friction(friction_plant(1.0, 80e3, c), 0.0, RIG_FRICTION).verdict == verdict


def test_the_friction_of_the_paper_lies_only_here():
    """Its rig: damping is proved; with integral action the constant weights do not reach (none of
    O2).
    """
    proof = prove_friction(RIG, pd(20e3, 60.0), RIG_FRICTION)
    assert proof.verdict == "proved"
    assert (
        "bristle friction with a stiffness up to 64 kN/m and a damping of 13 Ns/m, whose bristles"
        " creep" in proof.claim
    )
    assert "creep" not in proof.not_claimed
    assert prove_friction(RIG, pid(20e3, 3e5, 60.0), RIG_FRICTION).verdict == "not decided"
    refuted = prove_friction(RIG, pid(80e3, 1e5, 240.0), Bristle(64e3, 1 / 0.7), delay=T)
    assert refuted.verdict == "refuted"
    assert "a bristle of" in refuted.reason


def test_limits_of_a_bristle():
    """A spring alone as controller: stiction until what the microdamping gives back takes all of c
    = 20 Ns/m.
    """
    machine = friction_plant(1.0, 80e3, 20.0)
    for stiction, verdict in ((1 / 0.7, "proved"), (1 + 20 / 13, "not decided")):
        assert prove_friction(machine, 0.0, Bristle(64e3, stiction, 13.0)).verdict == verdict


def test_energy_falls_along_a_motion_with_lugre():
    """The judged energy just before every sample, along the loop with LuGre integrated by another
    hand.
    """
    K0, sigma = RIG_FRICTION.K0, RIG_FRICTION.microdamping
    loop = sliding_loop(RIG, pd(20e3, 60.0))
    claim = prove_friction(RIG, pd(20e3, 60.0), RIG_FRICTION).certificate.claim
    (port,) = claim.ports
    used, n, rest = port.rates, loop.F.shape[0], rest_of(loop)
    back = np.linalg.inv(claim.V)
    P = back.T @ claim.P[-1, -1] @ back

    def motion(_, s):
        xi, F, Fh = s[:n], s[n], s[n + 1 :]
        v = loop.v @ xi
        q = v - abs(v) * F / (0.7 + 0.3 * np.exp(-((v / 0.01) ** 2)))
        return np.concatenate([loop.F @ xi + loop.B * (F + sigma * q), [K0 * q], used * (F - Fh)])

    s = np.zeros(n + 1 + used.size)
    s[1] = 0.05  # a kick
    energies = []
    for _ in range(60):
        e = s[n + 1 :] - s[n]
        y = s[:n] - s[n] * rest
        z = np.concatenate([y, e])
        held = port.free * s[n] * (s[n] * (1 / K0 - loop.x @ rest) / 2 - loop.x @ y)
        energies.append(z @ P @ z + port.weights @ e**2 / (2 * K0) + held)
        s[:n] = loop.jumps[0] @ s[:n]
        s = solve_ivp(motion, (0, T), s, method="LSODA", rtol=1e-9, atol=1e-13).y[:, -1]
    assert (np.diff(energies) < 1e-9 * energies[0]).all()
    assert 0 < energies[-1] < 0.1 * energies[0]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Bristle(0.0), "K0 must be positive, got 0"),
        (lambda: Bristle(1.0, 0.9), "stiction must be at least 1"),
        (lambda: Bristle(1.0, 1.5, -1.0), "microdamping must be zero or positive, got -1"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
