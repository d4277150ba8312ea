"""Positive polynomials: decided on either side of a touching point, never where there is a root."""

import numpy as np
import pytest
from flint import arb, arb_poly, ctx, fmpq, fmpq_poly
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.proofs.exact.polynomials import positive_on_half_line


def product(factors):
    p = fmpq_poly([1])
    for factor in factors:
        p *= factor
    return p


def pair(real, imaginary):
    """(y - real)^2 + imaginary^2."""
    real, imaginary = (fmpq(*float(x).as_integer_ratio()) for x in (real, imaginary))
    return fmpq_poly([real * real + imaginary * imaginary, -2 * real, 1])


@pytest.mark.parametrize("small", [1e-3, 1e-9, 1e-12])
@pytest.mark.parametrize("kind", [lambda p: p, arb_poly])
def test_what_nearly_touches_zero_is_decided(kind, small):
    """Eight pairs over eight decades, one of them at a distance `small` from the axis."""
    others = [pair(10.0**k, 0.3 * 10.0**k) for k in range(-4, 4)]
    with ctx.workprec(320):
        assert positive_on_half_line(kind(product([*others, pair(2.0, 2.0 * small)]))).holds
        crossing = product([*others, pair(2.0, 0.0) - fmpq(1, 10**6)])
        found = positive_on_half_line(kind(crossing))
    assert not found.holds
    assert found.violated_at == pytest.approx(2, abs=1.1e-3)


def test_what_touches_zero_is_not_positive():
    found = positive_on_half_line(pair(3.0, 0.0))
    assert not found.holds


def test_zero_and_infinity():
    assert not positive_on_half_line(fmpq_poly([0, 1])).holds
    assert positive_on_half_line(fmpq_poly([0, 1])).violated_at == 0
    assert not positive_on_half_line(fmpq_poly([])).holds
    assert positive_on_half_line(fmpq_poly([2])).holds
    assert positive_on_half_line(fmpq_poly([1000, -1])).violated_at >= 1000


def test_coefficients_that_are_not_known_well_enough_are_undecided():
    found = positive_on_half_line(arb_poly([arb(1), arb(-2), arb(1, 1e-3)]))
    assert not found.holds
    assert found.needs_digits


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3)), min_size=1, max_size=6),
    st.lists(st.floats(1e-3, 1e3), max_size=3),
    st.integers(0, 2),
)
def test_roots_decide(pairs, negative, positive):
    """Pairs and negative roots leave it positive, any root on the positive axis does not."""
    rng = np.random.default_rng(len(pairs))
    factors = [pair(a, b) for a, b in pairs] + [
        fmpq_poly([fmpq(*r.as_integer_ratio()), 1]) for r in negative
    ]
    factors += [
        fmpq_poly([-fmpq(*r.as_integer_ratio()), 1]) for r in rng.uniform(0.1, 10, positive)
    ]
    p = product(factors)
    assert positive_on_half_line(p).holds == (positive == 0)
