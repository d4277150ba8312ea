"""Taylor models enclose what they stand for, and their error falls with the sixth power of the
length.
"""

import numpy as np
import pytest
from flint import arb, arb_poly, ctx

from robust.proofs.exact.taylor_models import (
    compose_polynomial,
    cosine,
    linear_model,
    lower_bound,
    sine,
)

P = [3.0, -2.0, 0.5, 1.0, -0.3, 0.2, 0.1, -0.05]


def jets(middle, half):
    omega = linear_model(middle, half)
    y = omega * omega
    return {
        "y": (y, lambda w: w**2),
        "cosine": (cosine(2 * middle, 2 * half), lambda w: np.cos(2 * w)),
        "polynomial": (
            compose_polynomial(arb_poly(P), y),
            lambda w: np.polynomial.polynomial.polyval(w**2, P),
        ),
        "of a cosine": (
            compose_polynomial(arb_poly(P), cosine(middle, half)),
            lambda w: np.polynomial.polynomial.polyval(np.cos(w), P),
        ),
        "product": (y * sine(middle, half) - y * 3, lambda w: w**2 * np.sin(w) - 3 * w**2),
    }


@pytest.mark.parametrize("name", list(jets(arb(1), arb(0.1))))
@pytest.mark.parametrize("middle", [0.25, 1.5])
def test_they_enclose(name, middle):
    widths = []
    for half in (0.2, 0.1):
        with ctx.workprec(128):
            jet, truth = jets(arb(middle), arb(half))[name]
            for x in np.linspace(-1, 1, 41):
                found = jet.p(arb(float(x)))
                there = float(truth(middle + half * x))
                assert abs(float(found.mid()) - there) <= float(found.rad()) + 1e-12
            widths.append(float(jet.p[0].rad()))
            least = min(truth(middle + half * np.linspace(-1, 1, 401)))
            assert least - 40 * half**2 - 2 * widths[-1] <= float(lower_bound(jet)) <= least + 1e-12
    assert widths[1] <= widths[0] / 40


def test_a_lower_bound_is_one_where_the_function_nearly_touches_zero():
    with ctx.workprec(128):
        x = linear_model(arb(0), arb(0.01))
        assert lower_bound(x * x + arb("1e-9")) > -1e-4
        short = linear_model(arb(0), arb("1e-5"))
        assert lower_bound(short * short + arb("1e-9")) > 0
