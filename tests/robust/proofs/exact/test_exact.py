"""Transfer functions over the rationals: against plain responses, hidden modes kept, hold and delay
enclosed.
"""

import control
import numpy as np
import pytest
from flint import acb, arb_poly, ctx, fmpq

from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.claim import to_matrices as matrices
from robust.proofs.exact.polynomials import (
    bilinear_image,
    delay_by_samples,
    to_rational,
    transfer_quotient,
    zoh_quotient,
)
from tests.support.random_loops import hold_and_delay, tf_response


def at(found, s):
    s = acb(s.real, s.imag)
    return complex(arb_poly(found.num)(s) / arb_poly(found.den)(s))


@pytest.mark.parametrize("seed", range(5))
def test_a_quotient_is_the_response(seed):
    rng = np.random.default_rng(seed)
    system = control.StateSpace(
        rng.normal(size=(5, 5)), rng.normal(size=(5, 1)), rng.normal(size=(1, 5)), [[0.3]]
    )
    omega = np.array([0.2, 1.0, 7.0])
    found = transfer_quotient(matrices(system))
    np.testing.assert_allclose(
        [at(found, 1j * w) for w in omega], tf_response(system, omega), rtol=1e-9
    )


def test_hidden_modes_stay():
    system = control.StateSpace(np.diag([-1.0, 3.0]), [[1.0], [0.0]], [[1.0, 1.0]], [[0.0]])
    found = transfer_quotient(matrices(system))
    assert (
        found.den
        - found.num * transfer_quotient(matrices(control.ss([[3.0]], [[0]], [[0]], [[0]]))).den
    ).degree() == 1
    assert found.den(fmpq(3)) == 0


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.1, 0.17, 0.3])
def test_hold_and_delay_enclose_the_sampled_plant(delay):
    """Against one long matrix exponential of plant, hold and delay line, and the axis moved by z =
    (1 + s)/(1 - s).
    """
    G = control.ss(control.tf([3, 1], [1, 0.4, 9]))
    there, omega = hold_and_delay(G, 0.1, delay), np.array([0.1, 3.0, 30.0])
    whole = int(np.floor(delay / 0.1 + 1e-9))
    rest = to_rational(delay) - whole * to_rational(0.1)
    with ctx.workprec(192):
        found = zoh_quotient(
            matrices(G),
            to_rational(0.1),
            whole=whole,
            rest=rest if rest > fmpq(1, 10**9) else fmpq(0),
        )
        moved = bilinear_image(found)
        direct = [at(found, np.exp(0.1j * w)) for w in omega]
        image = [at(moved, 1j * np.tan(0.05 * w)) for w in omega]
        assert max(float(c.rad()) for c in found.num.coeffs() + found.den.coeffs()) < 1e-40
    np.testing.assert_allclose(direct, tf_response(there, omega), rtol=1e-10)
    np.testing.assert_allclose(image, direct, rtol=1e-10)


def test_a_gain_behind_the_hold_and_samples_of_delay():
    """A constant under a delay of one and a half samples is seen two samples late."""
    gain = matrices(control.ss([], [], [], [[2.0]]))
    with ctx.workprec(128):
        assert (
            abs(at(zoh_quotient(gain, fmpq(1, 10), whole=1, rest=fmpq(1, 20)), 2.0 + 0j) - 0.5)
            < 1e-15
        )
    assert at(delay_by_samples(transfer_quotient(gain), 3), 2.0 + 0j) == 0.25


def test_what_is_no_system_is_refused():
    with pytest.raises(ValueError, match="B must be finite numbers of shape"):
        Matrices(A=np.zeros((2, 2)), B=np.zeros((1, 1)), C=np.zeros((1, 2)), D=np.zeros((1, 1)))
    with pytest.raises(ValueError, match="D must be finite"):
        Matrices(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=np.array([[np.nan]]))
