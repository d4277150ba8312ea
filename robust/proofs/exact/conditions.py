"""The inequalities of a claim at a frequency, as expressions that must be positive.

With plant N_G/D_G, controller N_K/D_K, weights w_n/w_d and P_n/P_d, N = N_G N_K exp(-s tau) and D =
D_G D_K, everything is written over the closed-loop polynomial D + N, so nothing becomes infinite at
a pole of plant or controller. Only sums and products of real quantities are formed, so the same
code works for polynomials, enclosures and numbers.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from flint import arb

from nlfrf._base.values import value
from robust.proofs.exact.claim import OPERATOR_PERFORMANCE, STABILITY

#: A polynomial, a Taylor model or a ball: anything with sums and products with its own kind and
#: with a ball. The types of python-flint do not express that. None stands for a weight that a loop
#: does not have, and is never used.
Quantity: TypeAlias = Any


@value
class Terms:
    """|N_G|^2, |D_G|^2, |N_K|^2, |D_K|^2, Re(N D*), |D + N|^2, the squared parts of both weights
    and of the scaling.
    """

    G_num: Quantity
    G_den: Quantity
    K_num: Quantity
    K_den: Quantity
    cross: Quantity
    closed: Quantity
    w_num: Quantity
    w_den: Quantity
    P_num: Quantity = None
    P_den: Quantity = None
    W_num: Quantity = None
    W_den: Quantity = None


def claim_inequalities(
    claim: str, reads: tuple[str, ...], *, inverse: bool, t: Terms, scaling: arb
) -> list[Quantity]:
    """Return expressions that are all positive if the claim holds; the form as in `LoopClaim`,
    scaling is d^2.
    """
    if "M" in reads:
        return _coprime_inequalities(claim, t, scaling)
    if claim == STABILITY:
        return [_stability_inequality(reads, t)]
    if claim == OPERATOR_PERFORMANCE:
        return _scaled_norm_inequality(reads, inverse, t=t, scaling=scaling)
    return _performance_inequality(reads, inverse, t)


def _perturbation_channel(reads: tuple[str, ...], t: Terms) -> Quantity:
    """Return |X|^2 with b = w X/(D + N)."""
    return (t.G_num if "G" in reads else t.G_den) * (t.K_num if "K" in reads else t.K_den)


def _stability_inequality(reads: tuple[str, ...], t: Terms) -> Quantity:
    """Return the inequality |b| < 1."""
    return t.w_den * t.closed - t.w_num * _perturbation_channel(reads, t)


def _performance_inequality(reads: tuple[str, ...], inverse: bool, t: Terms) -> list[Quantity]:
    """Return |w_P| |S| (|1 - a b*| + |a - b|) < 1 - |b|^2 (SP 7.6,
    `robust.lti.connections.worst_sensitivity`).
    """
    D, N = t.G_den * t.K_den, t.G_num * t.K_num
    if not inverse:  # a = 0: |w_P S| + |b| < 1
        return _root_sum_inequality(
            t.P_num * D * t.w_den,
            t.w_num * _perturbation_channel(reads, t) * t.P_den,
            t.P_den * t.w_den * t.closed,
        )
    inside = _stability_inequality(reads, t)
    if reads:  # a = w G, b = a S
        size, outer, before = t.w_num * t.G_num, t.K_den, t.w_den * t.G_den
    else:  # a = w, b = a S
        size, outer, before = t.w_num, D, t.w_den
    centre = t.w_den * before * t.closed + size * size * outer - t.w_den * size * (D + t.cross) * 2
    edge = size * t.w_den * N
    return [
        inside,
        *_root_sum_inequality(
            t.P_num * outer * centre, t.P_num * outer * edge, t.P_den * inside * inside
        ),
    ]


def _root_sum_inequality(a: Quantity, b: Quantity, c: Quantity) -> list[Quantity]:
    """Return sqrt(a) + sqrt(b) < sqrt(c) as inequalities without roots."""
    rest = c - a - b
    return [rest, rest * rest - a * b * 4]


def _scaled_norm_inequality(
    reads: tuple[str, ...], inverse: bool, *, t: Terms, scaling: arb
) -> list[Quantity]:
    """Return the inequalities for a norm of diag(w, w_P/d) M diag(1, d) below one.

    They are |M|_F^2 < 1 + |det M|^2 and |det M| < 1.
    """
    D, N = t.G_den * t.K_den, t.G_num * t.K_num
    whole = t.w_den * t.P_den * t.closed
    w, P = t.w_num * t.P_den, t.P_num * t.w_den
    both = t.w_num * t.P_num
    if not inverse:  # of rank one
        rows = w * t.K_num + P * t.K_den * (1 / scaling)
        columns = (t.G_num if "G" in reads else t.G_den) + t.G_den * scaling
        return [whole - rows * columns]
    through = _perturbation_channel(reads, t)
    size = w * (through + N * scaling) + P * (through * (1 / scaling) + D)
    determinant = both * through
    return [whole - determinant, whole - size + determinant]


def _coprime_inequalities(claim: str, t: Terms, scaling: arb) -> list[Quantity]:
    """Return the claims about normalised coprime factors, with k = |K| and g = |G| of the shaped
    loop, eps = |w|.

    Stability: eps^2 (1 + g^2)(1 + k^2) < |1 + L|^2. Performance: |w_P| (|1 + L - eps^2 (1 + g^2)| +
    eps sqrt(1 - eps^2) k (1 + g^2)) < |1 + L|^2 - eps^2 (1 + g^2)(1 + k^2). With one scaling:
    columns S/M (-K, 1, -1) and d S (K, L, 1), rows times w, w and w_P/d. docs/guide/coprime.md
    derives them.
    """
    D, WW = t.G_den * t.K_den, t.W_num * t.W_den
    plants = t.G_den * t.W_den + t.G_num * t.W_num  # 1 + g^2, over G_den W_den
    controllers = t.K_den * t.W_num + t.K_num * t.W_den  # 1 + k^2, over K_den W_num
    inside = t.w_den * WW * t.closed - t.w_num * plants * controllers
    if claim == STABILITY:
        return [inside]
    if claim != OPERATOR_PERFORMANCE:
        centre = t.G_den * t.closed * t.w_den * t.w_den * t.W_den * t.W_den
        centre = centre - t.w_num * t.w_den * t.W_den * plants * (D + t.cross) * 2
        centre = centre + t.w_num * t.w_num * plants * plants * t.K_den
        edge = t.w_num * (t.w_den - t.w_num) * t.K_num * WW * plants * plants
        over = t.P_num * t.K_den
        return [
            inside,
            *_root_sum_inequality(
                over * t.W_num * t.W_num * centre, over * edge, t.P_den * inside * inside
            ),
        ]
    whole = t.w_den * t.w_den * t.P_den * WW * t.closed
    errors = t.K_den * plants * (1 / scaling) + D * t.W_den
    inputs = controllers + t.K_num * t.W_den * scaling
    trace = (t.w_num * t.P_den * plants * inputs + t.P_num * t.w_den * t.W_num * errors) * t.w_den
    across = t.w_num * t.P_den * t.K_num * t.W_den * scaling + t.P_num * t.w_den * t.K_den * t.W_num
    determinant = t.w_num * plants * across
    return [whole - determinant, whole - trace + determinant]
