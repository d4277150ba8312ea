"""Peak and poles of a loop in 100 digits by plain evaluation, to hold rigorous proofs against: no
polynomials.
"""

from __future__ import annotations

import math

import numpy as np
from flint import acb, acb_mat, arb, arb_mat, ctx, fmpq, fmpq_mat

BITS = 330


def precise(A, B, C, D, s):
    """C (s - A)^-1 B + D by one solve."""
    n = A.nrows()
    if n == 0:
        return acb(D)
    pencil = acb_mat(
        n, n, [(s if i == j else acb(0)) - A[i, j] for i in range(n) for j in range(n)]
    )
    x = pencil.solve(acb_mat(B))
    return sum((C[0, k] * x[k, 0] for k in range(n)), acb(D))


def balls(matrix):
    return arb_mat(*matrix.shape, [arb(float(x)) for x in matrix.ravel()])


class PreciseLoop:
    """|b| and the worst |w_P S_p| of a loop at one frequency, from its matrices."""

    def __init__(self, G, K, w, form, delay=0.0, w_P=None):
        self.form, self.delay, self.dt = form, float(delay), float(G.dt or K.dt or 0)
        self.timed = bool(self.dt and not G.dt)
        self.parts = {"G": G, "K": K, "w": w, "P": w_P}
        with ctx.workprec(BITS):
            self.balls = {
                name: None
                if s is None
                else (balls(s.A), balls(s.B), balls(s.C), arb(float(s.D[0, 0])))
                for name, s in self.parts.items()
            }
            if self.timed:
                self.hold()

    def hold(self):
        """Phi and the two input matrices, by exponentials over the pieces of a sample."""
        A, B = self.balls["G"][:2]
        n = A.nrows()
        whole = math.floor(self.delay / self.dt + 1e-9)
        rest = arb(self.delay) - whole * arb(self.dt)
        if abs(float(rest.mid())) < 1e-9 * self.dt:
            rest = arb(0)

        def both(duration):
            rows = [[A[i, j] * duration for j in range(n)] + [B[i, 0] * duration] for i in range(n)]
            moved = arb_mat([*rows, [arb(0)] * (n + 1)]).exp()
            return (
                arb_mat(n, n, [moved[i, j] for i in range(n) for j in range(n)]),
                arb_mat(n, 1, [moved[i, n] for i in range(n)]),
            )

        T = arb(self.dt)
        self.whole, self.rest = whole, rest
        self.Phi = both(T)[0]
        after, self.late = both(T - rest)
        self.early = after * both(rest)[1]

    def plant(self, omega):
        z = acb(0, omega * self.dt).exp() if self.dt else acb(0, omega)
        A, B, C, D = self.balls["G"]
        if not self.timed:
            behind = (
                acb(0, -omega * arb(self.delay)).exp()
                if not self.dt
                else z ** -round(self.delay / self.dt)
            )
            return precise(A, B, C, D, z) * behind
        out = precise(self.Phi, self.late, C, arb(0), z) * z**-self.whole
        moved = self.whole
        if not self.rest.is_zero():
            out += precise(self.Phi, self.early, C, arb(0), z) * z ** -(self.whole + 1)
            moved += 1
        return out + D * z**-moved

    def part(self, name, omega):
        system = self.parts[name]
        discrete = bool(system.dt) or name == "K"
        s = acb(0, omega * self.dt).exp() if self.dt and discrete else acb(0, omega)
        return precise(*self.balls[name], s)

    def values(self, omega):
        """(|b|, worst |w_P S_p| or None) at omega [rad/s]."""
        with ctx.workprec(BITS):
            omega = arb(omega)
            G, K, w = self.plant(omega), self.part("K", omega), self.part("w", omega)
            S = 1 / (1 + G * K)
            a = {"inverse-multiplicative": w, "inverse-additive": w * G}.get(self.form, acb(0))
            X = {
                "multiplicative": G * K,
                "additive": K,
                "inverse-multiplicative": 1,
                "inverse-additive": G,
            }[self.form]
            b = w * X * S
            worst = None
            if self.parts["P"] is not None:
                edge = abs(1 - a * b.conjugate()) + abs(a - b)
                worst = abs(self.part("P", omega)) * abs(S) * edge / (1 - abs(b) ** 2)
            return abs(b), worst

    def peak(self, start, width=0.05, which=0):
        """(value, omega) of the largest value near a start, by golden section over omega."""
        low, high = start * (1 - width), start * (1 + width)
        if self.dt:
            high = min(high, math.pi / self.dt * (1 - 1e-15))
        golden = (math.sqrt(5) - 1) / 2

        def f(omega):
            return self.values(omega)[which].mid()

        x, y = high - golden * (high - low), low + golden * (high - low)
        fx, fy = f(x), f(y)
        for _ in range(70):
            if fx < fy:
                low, x, fx = x, y, fy
                y = low + golden * (high - low)
                fy = f(y)
            else:
                high, y, fy = y, x, fx
                x = high - golden * (high - low)
                fx = f(x)
        return max((f(omega), omega) for omega in (x, y, start))


def precise_gain(system, omega):
    """Largest singular value of a continuous system at one frequency, its matrices taken as they
    are.
    """
    with ctx.workprec(BITS):
        n = system.nstates
        A, B, C, D = (acb_mat(m.tolist()) for m in (system.A, system.B, system.C, system.D))
        pencil = acb_mat(
            n,
            n,
            [(acb(0, omega) if i == j else acb(0)) - A[i, j] for i in range(n) for j in range(n)],
        )
        G = C * pencil.solve(B) + D
        values = np.array([[complex(G[i, j]) for j in range(G.ncols())] for i in range(G.nrows())])
    return float(np.linalg.svd(values, compute_uv=False)[0])


def unstable_poles(G, K):
    """How many poles of 1/(1 + G K), all states kept, are not inside the stable region: of the
    matrices as they are.
    """
    A, B, C, d = map(rational, (G.A, G.B, G.C, G.D))
    Ak, Bk, Ck, dk = map(rational, (K.A, K.B, K.C, K.D))
    d, dk = d[0, 0], dk[0, 0]
    k = 1 / (1 + d * dk)  # e = -k (C x + d Ck xk), u = k (Ck xk - dk C x)
    blocks = (A - B * C * (k * dk), B * Ck * k), (Bk * C * (-k), Ak - Bk * Ck * (k * d))
    rows = [
        left + right
        for upper in blocks
        for left, right in zip(*(m.tolist() for m in upper), strict=True)
    ]
    polynomial = fmpq_mat(rows).charpoly().numer()
    with ctx.workprec(BITS):
        excess = [
            (abs(root) - 1 if K.dt else root.real, n) for root, n in polynomial.complex_roots()
        ]
        return sum(n for one, n in excess if not one < 0)


def wrongly_stable(case, report):
    """Whether a report calls a random loop stable that is not: its numbers as they are decide, not
    its eigenvalues.
    """
    return bool(report.nominally_stable and unstable_poles(case["in_loop"], case["K"]))


def rational(matrix):
    """The numbers of a matrix as they are."""
    rows, columns = matrix.shape
    return fmpq_mat(rows, columns, [fmpq(*float(x).as_integer_ratio()) for x in matrix.ravel()])


def just_above(case, excess, w_P=None):
    """The weight of a random case scaled so that its peak is 1 + excess, and that peak in many
    digits.
    """
    import control

    k = int(np.argmax(np.abs(case["b"])))
    w = case["w"]
    where = float(case["omega"][k])
    for _ in range(3):
        loop = PreciseLoop(case["G"], case["K"], w, case["form"], case["delay"])
        peak, where = loop.peak(where, width=1e-2)
        scale = float((arb(1) + arb(excess)) / peak)
        w = control.StateSpace(w.A, w.B, w.C * scale, w.D * scale, w.dt)
    loop = PreciseLoop(case["G"], case["K"], w, case["form"], case["delay"])
    return w, loop.values(where)[0], where
