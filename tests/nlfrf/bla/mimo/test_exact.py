"""Exact cases: what static nonlinearities of two and three inputs send where, by following every phase."""

from collections import defaultdict
from itertools import product

import numpy as np
import pytest

import nlfrf
from nlfrf.bla.mimo.counts import cross_factor, cross_variance
from nlfrf.bla.mimo.identify import identify
from nlfrf.signals.orthogonal import orthogonal_matrix

EXCITED = (1, 3, 9, 11, 17, 19)


def followed(powers, line, n_u=2, psi=True):
    """E|.|^2 of the FRF's error per column (or of the output amplitude), by summing terms of the same random phases.

    `powers`: which input each factor is, as (0, 0, 1) for u1^2 u2. Amplitudes one.
    """
    T = orthogonal_matrix(n_u, "dft")
    columns = [defaultdict(complex) for _ in range(n_u)]
    answers = [defaultdict(complex) for _ in range(n_u)]
    signed = [s * k for k in EXCITED for s in (1, -1)]
    for js in product(signed, repeat=len(powers)):
        if sum(js) != line:
            continue
        for e in range(n_u):
            phases, term = defaultdict(int), 0.5 ** len(powers) + 0j
            for a, j in zip(powers, js, strict=True):
                phases["phi", a, abs(j)] += np.sign(j)
                if psi:
                    phases["psi", e, abs(j)] += np.sign(j)
                term *= T[a, e] if j > 0 else T[a, e].conj()
            answers[e][frozenset((k, n) for k, n in phases.items() if n)] += 2 * term
            if line not in EXCITED:
                continue
            for c in range(n_u):
                own = dict(phases)
                own["phi", c, line] = own.get(("phi", c, line), 0) - 1
                if psi:
                    own["psi", e, line] = own.get(("psi", e, line), 0) - 1
                key = frozenset((k, n) for k, n in own.items() if n)
                columns[c][key] += 2 * term * T[c, e].conj() / n_u
    mean = [col.get(frozenset(), 0.0) for col in columns]
    variance = [sum(abs(v) ** 2 for key, v in col.items() if key) for col in columns]
    return np.array(mean), np.array(variance), sum(abs(v) ** 2 for v in answers[0].values())


def test_the_cube_of_one_input():
    for line, expected in {1: 6.46875, 9: 7.0625, 19: 4.21875}.items():
        mean, variance, _ = followed((0, 0, 0), line)
        np.testing.assert_allclose(mean, [8.25, 0], atol=1e-12)
        np.testing.assert_allclose(variance, [expected, expected], atol=1e-12)
    for line, expected in {5: 15.75, 7: 17.4375, 13: 12.9375, 15: 11.25}.items():
        assert followed((0, 0, 0), line)[2] == pytest.approx(expected, abs=1e-12)


def test_without_psi_the_cube_of_one_input_is_in_one_column():
    np.testing.assert_allclose(followed((0, 0, 0), 1, psi=False)[1], [12.9375, 0], atol=1e-12)


def test_the_cross_term_of_two_inputs():
    for line, expected in {1: (2.34375, 4.90625), 9: (2.4375, 5.0), 19: (1.59375, 4.15625)}.items():
        mean, variance, _ = followed((0, 0, 1), line)
        np.testing.assert_allclose(mean, [0, 3], atol=1e-12)
        np.testing.assert_allclose(variance, expected, atol=1e-12)


@pytest.mark.parametrize("powers", [(0, 0, 1)])
def test_the_counts_are_those_of_the_terms(powers):
    excited = np.array(EXCITED)
    detection = np.array([5, 7, 13, 15])
    counted = cross_variance(np.ones(6), np.ones(6), excited, np.concatenate([excited, detection]))
    np.testing.assert_allclose(counted[6:], [5.75, 6.1875, 4.6875, 4.25], atol=1e-9)
    np.testing.assert_allclose(counted[6:], [followed(powers, k)[2] for k in detection], atol=1e-9)
    # over a set the two columns share the variance of an experiment
    np.testing.assert_allclose(counted[:6], [followed(powers, k)[1].sum() for k in excited], atol=1e-9)


def test_three_inputs():
    found = [followed((0, 1, 2), k, n_u=3)[2] for k in (1, 9, 19, 5, 7, 13, 15)]
    np.testing.assert_allclose(found, [4.5, 4.5625, 3.75, 3, 3.1875, 2.4375, 2.25], atol=1e-12)


def test_the_product_of_two_inputs_answers_on_even_lines_alone():
    """4 (p_a * p_b)(k), p = 1/4 on both sides of every line."""
    signed = [s * k for k in EXCITED for s in (1, -1)]
    for k in range(1, 39):
        pairs = sum(j + m == k for j in signed for m in signed)
        assert followed((0, 1), k)[2] == pytest.approx(4 * pairs / 16, abs=1e-12)
        assert pairs == 0 or k % 2 == 0


def test_counts_of_different_spectra_against_a_plain_sum():
    excited, lines = np.array([2, 3, 7]), np.arange(1, 24)
    a, b = np.array([1.0, 2.0, 0.5]), np.array([0.3, 1.0, 2.0])
    size = {**{s * k: x for k, x in zip(excited, a, strict=True) for s in (1, -1)}}
    other = {**{s * k: x for k, x in zip(excited, b, strict=True) for s in (1, -1)}}
    expected = []
    for k in lines:
        terms = defaultdict(float)
        for i, j, m in product(size, size, other):
            if i + j + m == k and i != -j:
                terms[frozenset([(i, j), (j, i)]), m] += 2 * size[i] * size[j] * other[m] / 8
        expected.append(sum(v**2 for v in terms.values()))
    np.testing.assert_allclose(cross_variance(a, b, excited, lines), expected, atol=1e-10)


def test_special_odd_reads_three_times_too_low_in_a_narrow_band_for_both_monomials():
    ms = nlfrf.multisine(fs=4096, n_samples=4096, f_min=800, f_max=1000, rng=1)
    near = np.argsort(np.abs(ms.lines.odd - ms.lines.excited[:, None]), axis=1)[:, :6]
    factor = cross_factor(ms.amplitude[None], ms.lines.excited, ms.lines.odd, near)
    assert 2.5 < np.median(factor) <= 3


def test_a_static_nonlinearity_over_many_sets_is_its_mean_gradient():
    """E[grad f]: 3 sigma^2 for u1^3 and sigma^2 for u1^2 u2, but for what the line itself takes out."""
    ms = nlfrf.multisine("odd", fs=512, n_samples=512, f_min=1, f_max=200, n_inputs=2, n_realizations=40, rng=1)
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    frm = identify(nlfrf.MultiRecord(u=u, y=np.stack([u[0] ** 3, u[0] ** 2 * u[1]]), fs=512, lines=ms.lines))
    A2 = ms.amplitude[0] ** 2
    expected = np.zeros_like(frm.G)
    expected[0, 0], expected[1, 1] = 3 - 0.75 * A2, 1.0
    assert np.all(np.abs(frm.G - expected) < frm.bound(0.9999, simultaneous=True))
    assert frm.level_source == "realizations"


def test_one_phase_for_all_inputs_reads_the_cross_term_three_times_too_high():
    ms = nlfrf.multisine("odd", fs=512, n_samples=512, f_min=1, f_max=200, n_inputs=2, n_realizations=40, rng=1)
    psi = np.random.default_rng(0).uniform(0, 2 * np.pi, (1, 80, ms.f.size))
    T = np.angle(orthogonal_matrix(2, "dft"))
    copied = nlfrf.OrthogonalMultisine(
        fs=512,
        n_samples=512,
        kind="odd",
        lines=ms.lines,
        design="orthogonal",
        amplitude=ms.amplitude,
        phase=psi + np.tile(T, 40)[:, :, None],
    )
    u = np.repeat(copied.u[:, :, None], 2, axis=2)
    with pytest.warns(nlfrf.DataWarning, match=r"inputs of an experiment have the same phases \(phi\)"):
        frm = identify(nlfrf.MultiRecord(u=u, y=np.stack([u[0] ** 2 * u[1], u[0]]), fs=512, lines=ms.lines))
    # copies but for signs: u1^2 u2 = +-u1^3, whose BLA is 3 sigma^2
    assert np.median(frm.G[0, 1].real) == pytest.approx(3, rel=0.1)
