"""Transfer functions as quotients of polynomials whose coefficients are exact rationals, or balls that hold them.

A stored double is a rational number and is taken as that. For a single-loop system, with D(s) = det(s - A),
C adj(s - A) B = D(s) - det(s - A - B C): hidden modes stay in. A plant behind a hold has the exponential of its matrix,
enclosed with its remainder. Discrete systems are moved from the unit circle to the imaginary axis by
z = (1 + s)/(1 - s), which is exact.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.shared.values import value
from robust.verification.claim import Matrices

__all__ = ["Quotient", "behind_samples", "held", "mapped", "quotient", "rational", "rational_matrix"]


@value
class Quotient:
    """num/den as polynomials in s or z (python-flint), both of formal degree `degree` at most."""

    num: Any
    den: Any
    degree: int


def rational(x: float) -> Any:
    """A double as the rational number that it is (fmpq)."""
    from flint import fmpq

    return fmpq(*float(x).as_integer_ratio())


def rational_matrix(matrix: np.ndarray) -> Any:
    """A matrix of doubles as rationals (fmpq_mat)."""
    from flint import fmpq_mat

    return fmpq_mat(*matrix.shape, [rational(x) for x in matrix.ravel()])


def quotient(system: Matrices) -> Quotient:
    """The transfer function of a single-loop system, exactly.

    >>> import numpy as np
    >>> A, B, C, D = np.array([[-2.0]]), np.ones((1, 1)), np.ones((1, 1)), np.array([[0.5]])
    >>> g = quotient(Matrices(A=A, B=B, C=C, D=D))                  # 1/(s + 2) + 1/2 = (s/2 + 2)/(s + 2)
    >>> str(g.num), str(g.den)
    ('1/2*x + 2', 'x + 2')
    """
    from flint import fmpq_poly

    direct = rational(system.D[0, 0])
    if system.order == 0:
        return Quotient(num=fmpq_poly([direct]), den=fmpq_poly([1]), degree=0)
    A = rational_matrix(system.A)
    den = A.charpoly()
    num = den - (A + rational_matrix(system.B) * rational_matrix(system.C)).charpoly()
    return Quotient(num=num + direct * den, den=den, degree=system.order)


def behind_samples(system: Quotient, whole: int) -> Quotient:
    """A discrete system behind a delay of whole samples."""
    return Quotient(num=system.num, den=system.den.left_shift(whole), degree=system.degree + whole)


def held(plant: Matrices, dt: Any, whole: int, rest: Any) -> Quotient:
    """A continuous plant as a sampled controller sees it: zero-order hold, delay of whole dt + rest, sampler.

    The input changes inside a sample where rest > 0 (Åström & Wittenmark, 3rd ed., 2.3). Coefficients are balls that
    hold the exponentials; dt and rest are rationals.
    """
    from flint import arb, arb_mat, arb_poly, fmpq_mat

    direct = arb(rational(plant.D[0, 0]))
    n, memory = plant.order, whole + (1 if rest > 0 else 0)
    if n == 0:
        num, den = arb_poly([0]), arb_poly([1])
    else:
        both = [[rational(x) for x in (*plant.A[i], plant.B[i, 0])] for i in range(n)] + [[0] * (n + 1)]
        generator = fmpq_mat(both)

        def step(duration: Any) -> tuple[Any, Any]:
            moved = arb_mat(generator * duration).exp().tolist()
            return arb_mat([row[:n] for row in moved[:n]]), arb_mat([row[n:] for row in moved[:n]])

        C = arb_mat(rational_matrix(plant.C))
        Phi, late = step(dt)
        parts = [(late, whole)]
        if rest > 0:
            after, late = step(dt - rest)
            parts = [(late, whole), (after * step(rest)[1], whole + 1)]
        den = Phi.charpoly()
        num = arb_poly([0])
        for column, delay in parts:
            num += (den - (Phi + column * C).charpoly()).left_shift(memory - delay)
    return Quotient(num=num + direct * den, den=den.left_shift(memory), degree=n + memory)


def mapped(system: Quotient) -> Quotient:
    """The image of a discrete system under z = (1 + s)/(1 - s): the unit circle becomes the imaginary axis."""
    return Quotient(
        num=moebius(system.num, system.degree), den=moebius(system.den, system.degree), degree=system.degree
    )


def moebius(p: Any, degree: int) -> Any:
    """(1 - s)^degree p((1 + s)/(1 - s)); with v = 1 - s the argument is 2/v - 1."""
    kind = type(p)
    shifted = p(kind([-1, 2]))
    coefficients = [shifted[k] for k in range(degree, -1, -1)]
    return kind(coefficients)(kind([1, -1]))
