"""Exact cases: what static nonlinearities of two and three inputs send where, by following every
phase.
"""

from collections import defaultdict
from itertools import product

import numpy as np
import pytest
from scipy.linalg import dft

import nlfrf
from nlfrf import identify
from nlfrf.bla.distortion import cubic_count_ratios
from nlfrf.bla.line_index import index_lines

EXCITED = (1, 3, 9, 11, 17, 19)


def followed(powers, line, n_u=2, psi=True):
    """E|.|^2 of the FRF's error per column (or of the output amplitude), by summing terms of the
    same random phases.

    `powers`: which input each factor is, as (0, 0, 1) for u1^2 u2. Amplitudes one.
    """
    T = dft(n_u)
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


def cross_variance(a, excited, lines):
    """Variance of y = u_1^2 u_2 over random phases of flat or shaped inputs, by plain sums; a (F,)
    amplitudes of both.

    E|Y(k)|^2 = 4 [2 (p*p*p)(k) - sum_{2j+m=k} p(j)^2 p(m)], p = a^2 / 4; at an excited line without
    the triples (j, -j, k) that make up the BLA, sigma_1^2 in column 2.
    """
    last = int(lines.max() + 2 * excited.max())
    p, doubled = np.zeros(2 * last + 1), np.zeros(2 * last + 1)
    for k, x in zip(excited, a, strict=True):
        p[[last + k, last - k]] = x**2 / 4
    for j in excited[2 * excited <= last]:
        doubled[[last + 2 * j, last - 2 * j]] = p[last + j] ** 2
    counts = 2 * np.convolve(np.convolve(p, p, "same"), p, "same") - np.convolve(doubled, p, "same")
    coherent = 2 * p[last + lines] * np.sum(p**2)
    return 4 * (counts[last + lines] - coherent)


def test_the_counts_are_those_of_the_terms():
    excited = np.array(EXCITED)
    detection = np.array([5, 7, 13, 15])
    counted = cross_variance(np.ones(6), excited, np.concatenate([excited, detection]))
    np.testing.assert_allclose(counted[6:], [5.75, 6.1875, 4.6875, 4.25], atol=1e-9)
    np.testing.assert_allclose(
        counted[6:], [followed((0, 0, 1), k)[2] for k in detection], atol=1e-9
    )
    # over a set the two columns share the variance of an experiment
    np.testing.assert_allclose(
        counted[:6], [followed((0, 0, 1), k)[1].sum() for k in excited], atol=1e-9
    )


@pytest.mark.parametrize(("f_min", "f_max"), [(800, 1000), (1, 400), (100, 900)])
@pytest.mark.parametrize("kind", ["special-odd", "random-odd"])
def test_a_product_of_inputs_stands_over_its_detection_lines_as_a_cube_does(kind, f_min, f_max):
    """So the hypotheses of a cubic hold for products of inputs, within what a calibration is
    uncertain by.
    """
    ms = nlfrf.multisine(kind, fs=4096, n_samples=4096, f_min=f_min, f_max=f_max, rng=1)
    where, excited = index_lines(ms.lines), ms.lines.excited
    relative, cube = cubic_count_ratios(ms.amplitude, where, 3.0)
    counts = cross_variance(ms.amplitude, excited, np.concatenate([excited, where.detection]))
    window = counts[excited.size :].take(where.odd_windows.T)
    product = counts[: excited.size] / window.mean(axis=0)
    assert np.abs(10 * np.log10(product / cube)).max() < 0.3
    assert np.abs(10 * np.log10(window / window.mean(axis=0) / relative)).max() < 0.8


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


def test_a_static_nonlinearity_over_many_sets_is_its_mean_gradient():
    """E[grad f]: 3 sigma^2 for u1^3 and sigma^2 for u1^2 u2, but for what the line itself takes
    out.
    """
    ms = nlfrf.multisine(
        "odd", fs=512, n_samples=512, f_min=1, f_max=200, n_inputs=2, n_realizations=40, rng=1
    )
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    frm = identify(
        nlfrf.Record(u=u, y=np.stack([u[0] ** 3, u[0] ** 2 * u[1]]), fs=512, lines=ms.lines)
    )
    A2 = ms.amplitude[0] ** 2
    expected = np.zeros_like(frm.G)
    expected[0, 0], expected[1, 1] = 3 - 0.75 * A2, 1.0
    assert np.all(np.abs(frm.G - expected) < frm.bound(0.9999, simultaneous=True))
    assert frm.level_source == "realizations"


def test_one_phase_for_all_inputs_reads_the_cross_term_three_times_too_high():
    ms = nlfrf.multisine(
        "odd", fs=512, n_samples=512, f_min=1, f_max=200, n_inputs=2, n_realizations=40, rng=1
    )
    psi = np.random.default_rng(0).uniform(0, 2 * np.pi, (1, 80, ms.f.size))
    T = np.angle(dft(2))
    copied = nlfrf.Multisine(
        fs=512,
        n_samples=512,
        kind="odd",
        lines=ms.lines,
        design="orthogonal",
        amplitude=ms.amplitude,
        phase=psi + np.tile(T, 40)[:, :, None],
    )
    u = np.repeat(copied.u[:, :, None], 2, axis=2)
    with pytest.warns(
        nlfrf.DataWarning, match=r"inputs of an experiment have the same phases \(phi\)"
    ):
        frm = identify(
            nlfrf.Record(u=u, y=np.stack([u[0] ** 2 * u[1], u[0]]), fs=512, lines=ms.lines)
        )
    # copies but for signs: u1^2 u2 = +-u1^3, whose BLA is 3 sigma^2
    assert np.median(frm.G[0, 1].real) == pytest.approx(3, rel=0.1)
