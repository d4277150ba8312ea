"""Stability in exact arithmetic: on the boundary itself, beside it by one unit in the last place,
behind delays.
"""

import numpy as np
import pytest
from flint import arb_poly, ctx, fmpq, fmpq_poly

from robust.proofs.exact.polynomials import Quotient, bilinear_image, hurwitz, to_rational
from robust.proofs.exact.stability import hurwitz_with_delay


def from_roots(roots):
    return fmpq_poly([to_rational(c) for c in np.poly(roots).real[::-1]])


@pytest.mark.parametrize("seed", range(12))
def test_random_polynomials(seed):
    rng = np.random.default_rng(seed)
    upper = rng.normal(size=4) * 0.5 - 0.6 + 1j * rng.normal(size=4)
    p = from_roots(np.concatenate([upper, upper.conj(), -rng.uniform(0.01, 100, 3)]))
    assert hurwitz(p, 11).holds == bool(np.all(upper.real < 0))
    with ctx.workprec(192):
        assert hurwitz(arb_poly(p), 11).holds == bool(np.all(upper.real < 0))
        assert hurwitz(-arb_poly(p), 11).holds == bool(np.all(upper.real < 0))


@pytest.mark.parametrize(
    "p", [[1, 1, 1, 1], [0, 1, 1], [1, 0, 1], [1, 0, 2, 0, 1], [4, 4, 5, 4, 1]]
)
def test_roots_on_the_axis_are_not_stable_in_exact_arithmetic(p):
    found = hurwitz(fmpq_poly(p), len(p) - 1)
    assert not found.holds
    assert found.violated


def test_a_root_at_infinity_is_not_stable():
    assert hurwitz(fmpq_poly([1, 2]), 1).holds
    assert not hurwitz(fmpq_poly([1, 2]), 2).holds


def test_one_unit_in_the_last_place_of_the_circle():
    """z - a, and z^2 + a with its pair at the distance sqrt(a)."""
    below, above = np.nextafter(1, 0), np.nextafter(1, 2)
    for a, stable in ((below, True), (1.0, False), (above, False)):
        for p in ([-to_rational(a), 1], [to_rational(a), 0, 1]):
            system = bilinear_image(
                Quotient(num=fmpq_poly([1]), den=fmpq_poly(p), degree=len(p) - 1)
            )
            assert hurwitz(system.den, system.degree).holds == stable


def test_thirty_states_that_floating_point_loses():
    """Thirty poles within 1e-3 of each other, one of them 1e-12 unstable."""
    poles = [fmpq(-1) - fmpq(k, 30_000) for k in range(29)]
    for last, stable in ((-fmpq(1, 10**12), True), (fmpq(1, 10**12), False)):
        p = fmpq_poly([1])
        for root in [*poles, last]:
            p *= fmpq_poly([-root, 1])
        assert hurwitz(p, 30).holds == stable


@pytest.mark.parametrize(
    ("delay", "stable"), [(np.pi / 2, True), (np.nextafter(np.pi / 2, 2), False), (8.0, False)]
)
def test_an_integrator_behind_a_delay(delay, stable):
    """s + exp(-s tau) is stable for tau < pi/2, which no double is."""
    assert (
        hurwitz_with_delay(
            fmpq_poly([0, 1]), fmpq_poly([1]), degree=1, delay=to_rational(delay)
        ).holds
        == stable
    )


def test_a_delay_that_stabilises():
    """s^2 + 1 behind -0.5 exp(-s tau): poles at +-j sqrt(0.5) at tau = 0 move in first, and out
    again later.
    """
    den, num = fmpq_poly([1, 0, 1]), fmpq_poly([fmpq(-1, 2)])
    assert not hurwitz_with_delay(den, num, degree=2, delay=fmpq(0)).holds
    shifted = den + fmpq_poly([0, -fmpq(1, 100)])  # at tau = 0 clearly unstable by 0.005
    found = [
        hurwitz_with_delay(shifted, num, degree=2, delay=to_rational(tau)).holds
        for tau in (0.01, 1.0, 6.0)
    ]
    assert found == [False, True, False]


def test_a_delay_with_a_known_limit():
    """5 exp(-s tau)/(s + 1): |L| = 1 at sqrt(24), where the phase left is pi - atan(sqrt(24))."""
    limit = (np.pi - np.arctan(np.sqrt(24))) / np.sqrt(24)
    den, num = fmpq_poly([1, 1]), fmpq_poly([5])
    assert hurwitz_with_delay(den, num, degree=1, delay=to_rational(limit * (1 - 1e-14))).holds
    assert not hurwitz_with_delay(den, num, degree=1, delay=to_rational(limit * (1 + 1e-14))).holds


@pytest.mark.parametrize(("num", "den"), [([1, 1], [2, 1]), ([3, 2], [1, 1]), ([-1], [1, 1])])
def test_what_a_delay_leaves_open_is_not_stable(num, den):
    """A gain of one or more at infinite frequency, and a pole at zero whatever the delay."""
    assert not hurwitz_with_delay(fmpq_poly(den), fmpq_poly(num), degree=1, delay=fmpq(1, 10)).holds
