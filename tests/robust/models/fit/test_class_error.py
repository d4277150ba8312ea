"""What a class of few poles misses of a machine with many: an error of its own, kept from the loop
asked for.
"""

import control
import numpy as np
import pytest

import nlfrf
import robust
from robust.models import scan_orders
from tests.support.printed import unwrapped

pytestmark = pytest.mark.filterwarnings(
    "ignore::robust.DesignWarning"
)  # each is looked for in the value
F = np.arange(1.0, 150.25, 0.5)
S = 2j * np.pi * F
CROSSOVER = 2 * np.pi * 12
MODES = (
    (0.3, 60, 0.02),
    (-0.2, 87, 0.015),
    (0.25, 110, 0.03),
    (0.1, 131, 0.02),
    (-0.15, 160, 0.02),
    (0.2, 240, 0.02),
)


def stage(s=S):
    """(F,) a free stage with six modes and a delay."""
    flexible = (a / (s**2 + 4 * z * np.pi * f * s + (2 * np.pi * f) ** 2) for a, f, z in MODES)
    return (1 / (s * (s + 5)) + sum(flexible)) * np.exp(-5e-4 * s)


def measured(G, std, seed=0):
    rng = np.random.default_rng(seed)
    e = (rng.standard_normal(G.shape) + 1j * rng.standard_normal(G.shape)) / np.sqrt(2) * std
    return nlfrf.bla_from_frf(F, G + e, std=std)


#: Where the scatter of a line is smallest: at high frequencies, nowhere, at low frequencies.
PRECISIONS = {
    "falling": np.interp(F, [1, 150], [5e-3, 1e-4]) * np.abs(stage()),
    "level": 1e-3 * np.abs(stage()),
    "of y": np.full(F.size, 1e-3 * np.abs(stage()[100])),
}


@pytest.mark.parametrize("precision", PRECISIONS)
def test_few_poles_serve_the_loop_wherever_the_scatter_is_smallest(precision):
    bla = measured(stage(), PRECISIONS[precision])
    fit = robust.fit_nominal(bla, n_poles=4, omega_c=CROSSOVER)
    assert "does not fit the measurement" in fit.warnings[0]
    low = F < 12
    assert (
        np.abs(fit.response[low] / stage()[low] - 1).max() < 0.06
    )  # 1e5 by the scatter alone where it falls
    assert "error of the class: " in unwrapped(fit)
    assert "of |G| below 12 Hz" in unwrapped(fit)
    model = robust.uncertainty(bla, fit)
    assert model.radius[low].max() < 0.1
    plant = robust.sampled(model.nominal, 1e-3)
    K = robust.ncfsyn(plant, robust.shaping.crossover_weight(plant, CROSSOVER)).K
    assert robust.check(model, K).verdict == "statistically robust"
    assert "below the crossover of 12 Hz" in unwrapped(model)


def test_where_the_class_holds_the_machine_the_crossover_changes_nothing():
    G = 3e3 / (S**2 + 8 * S + (2 * np.pi * 20) ** 2)
    bla = measured(G, 1e-3 * np.abs(G))
    alone, asked = (
        robust.fit_nominal(bla, n_poles=2, omega_c=omega_c) for omega_c in (None, CROSSOVER)
    )
    assert not np.any(asked.class_std)
    np.testing.assert_allclose(asked.response, alone.response, rtol=1e-9)
    assert np.isnan(alone.omega_c)
    assert asked.omega_c == CROSSOVER


def constant_fit(f, G, std, **options):
    """Fit a constant to any FRF: nearly all that is left is the error of the class."""
    bla = nlfrf.bla_from_frf(f, G, std=std)
    return robust.fit_nominal(bla, n_poles=0, **options)


def test_the_size_of_the_error_is_found_with_its_scatter():
    """Of N complex errors the relative standard deviation of the size is 1/(2 sqrt(N)) where
    scatter is small.
    """
    rng, n, found = np.random.default_rng(3), 400, []
    for _ in range(40):
        e = (rng.standard_normal(n) + 1j * rng.standard_normal(n)) / np.sqrt(2)
        std = rng.uniform(0.005, 0.02, n)
        fit = constant_fit(np.arange(1.0, n + 1), 1 + e * np.sqrt(std**2 + 0.1**2), std)
        found.append(np.mean(fit.class_std))
    assert np.mean(found) == pytest.approx(0.1, rel=4 * 0.025 / np.sqrt(40) + 0.01)
    assert np.std(found) == pytest.approx(0.0025, rel=0.5)


def test_an_antiresonance_counts_as_its_octave_and_the_loop_as_its_square():
    """class_std is a multiple of m: of |G| at 100 Hz, where |G| is smooth."""
    G = (S**2 + 0.1 * S + (2 * np.pi * 30) ** 2) / S**2
    std = 1e-4 * np.abs(G)
    smooth, k = np.argmin(np.abs(F - 100)), int(np.argmin(np.abs(G)))
    alone = constant_fit(F, G, std).class_std
    assert alone[k] / alone[smooth] > 20 * np.abs(G[k] / G[smooth])
    both = constant_fit(F, G, std, omega_c=CROSSOVER).class_std
    first = np.argmin(np.abs(F - 24))
    T = target_of(alone, both)
    L = 1 / np.sqrt(1 / T[first:] ** 2 - 1)
    n = -np.polyfit(np.log(F[first:]), np.log(L), 1)[0]
    np.testing.assert_allclose(L, (F[first:] / 24) ** -n, rtol=0.02)
    mixed = np.random.default_rng(0).permutation(F.size)
    parts = [np.sort(mixed[:150]), np.sort(mixed[150:])]
    blas = [nlfrf.bla_from_frf(F[one], G[one], std=std[one]) for one in parts]
    # lines of several records stand one after the other
    several = robust.fit_nominal(blas, n_poles=0, omega_c=CROSSOVER).class_std
    np.testing.assert_allclose(several, both[np.concatenate(parts)], rtol=1e-3)


def target_of(alone, both):
    """|T_c| from errors of the class without and with a crossover; one at the first line."""
    share = np.sqrt(alone / both)
    return share / share[0]


@pytest.mark.parametrize(("slope", "falls_by"), [(0, 1), (0.5, 1.5), (1, 2), (2, 2), (-1, 1)])
def test_beyond_the_crossover_the_loop_falls_by_one_slope_and_with_the_plant_by_up_to_two(
    slope, falls_by
):
    """As L = K G does: K falls with a flat plant, and gives a mass its lead."""
    f = np.geomspace(0.024, 2400, 501)
    G = (f / 24.0) ** -slope * np.exp(1j * np.arange(f.size))
    alone, both = (
        constant_fit(f, G, 1e-4 * np.abs(G), omega_c=omega_c).class_std
        for omega_c in (None, CROSSOVER)
    )
    T = target_of(alone, both)
    assert np.interp(24, f, T) == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert T[-1] / np.interp(240, f, T) == pytest.approx(0.1**falls_by, rel=0.05)


@pytest.mark.parametrize("shape", [(1, 2), (2, 1), (2, 2), (2, 3), (3, 2), (4, 4)])
def test_rows_and_columns_do_not_depend_on_units(shape):
    """The error of the class has the mean squares of the rows and columns of |G|."""
    rng = np.random.default_rng(shape)
    size = rng.uniform(0.1, 1.0, shape)
    G = size[..., None] * np.exp(1j * rng.uniform(0, 2 * np.pi, (*shape, 40)))
    left, right = (10 ** rng.uniform(-1.5, 1.5, n) for n in shape)
    units = left[:, None] * right
    found = []
    for scale in (1.0, units):
        bla = nlfrf.bla_from_frf(
            np.arange(1.0, 41),
            np.moveaxis(scale * np.moveaxis(G, 2, 0), 0, 2),
            std=1e-4 * np.multiply.outer(scale * np.ones(shape), np.ones(40)),
            inputs=[f"u{k}" for k in range(shape[1])],
            outputs=[f"y{k}" for k in range(shape[0])],
        )
        error = robust.fit_nominal(bla, n_poles=0, n_zeros=0).class_std
        np.testing.assert_allclose(error, error[..., :1] * np.ones(40), rtol=1e-9)
        found.append(error[..., 0])
    shares = np.mean((size / found[0]) ** 2, axis=0)
    np.testing.assert_allclose(shares, shares[0], rtol=1e-3)
    np.testing.assert_allclose(np.mean((size / found[0]) ** 2, axis=1), shares[0], rtol=1e-3)
    np.testing.assert_allclose(np.linalg.svd(found[0])[1][1:], 0, atol=1e-9)
    np.testing.assert_allclose(found[1] / units, found[0], rtol=1e-2)


def matrix(G, std, seed=0):
    rng = np.random.default_rng(seed)
    e = (rng.standard_normal(G.shape) + 1j * rng.standard_normal(G.shape)) / np.sqrt(2) * std
    return nlfrf.bla_from_frf(F, G + e, std=std, inputs=("u1", "u2"), outputs=("y1", "y2"))


@pytest.mark.parametrize("compared", [False, pytest.param(True, marks=pytest.mark.attack)])
def test_several_channels_in_any_units_serve_the_loop_too(compared):
    """Two axes that share modes, one in units a thousand times smaller; eight poles are missing."""
    shapes = np.random.default_rng(1).normal(size=(len(MODES), 2, 2))
    rigid = np.array([[1.0, 0.2], [0.1, 0.8]])[:, :, None] / (S * (S + 5))
    G = rigid + sum(
        np.outer(c, b)[:, :, None] * a / (S**2 + 4 * z * np.pi * f * S + (2 * np.pi * f) ** 2)
        for (c, b), (a, f, z) in zip(shapes, MODES, strict=True)
    )
    std = np.linalg.norm(G, axis=(0, 1)) * np.interp(F, [1, 150], [5e-3, 1e-4]) * np.ones((2, 2, 1))
    units = np.array([[1.0], [1e3]])[:, :, None]
    low, fits = F < 12, []
    for scale in (units, 1.0)[: 1 + compared]:
        fits.append(
            robust.fit_nominal(
                matrix(scale * G, scale * std), n_poles=6, rank=2, omega_c=CROSSOVER
            ).response
        )
        error = np.linalg.norm((fits[-1] / scale - G)[..., low], axis=(0, 1)) / np.linalg.norm(
            G[..., low], axis=(0, 1)
        )
        assert error.max() < 0.1
    if compared:  # the searches end near one another, not at one point
        for one in fits[0] / units - fits[1]:
            assert np.abs(one[..., low]).max() < 0.02 * np.abs(fits[1]).max()


def test_of_several_levels_the_nominal_stands_in_the_middle():
    """Two levels, a gain of 0.8 and one of 1.25, the second measured ten times better."""
    G = 3e3 / (S**2 + 40 * S + (2 * np.pi * 20) ** 2)
    blas = [measured(0.8 * G, 1e-2 * np.abs(G), 1), measured(1.25 * G, 1e-3 * np.abs(G), 2)]
    fit = robust.fit_nominal(blas, n_poles=2, n_zeros=0, omega_c=CROSSOVER)
    assert np.abs(fit.response[:10] / G[:10]).mean() == pytest.approx(
        1.025, abs=0.03
    )  # 1.245 by the scatter


def test_the_smallest_order_that_lets_the_loop_be_is_taken_and_no_higher_one_tried():
    bla = measured(stage(), PRECISIONS["falling"])
    scan = scan_orders(bla, omega_c=CROSSOVER)
    assert scan.best == scan.n_poles.max() <= 4
    assert scan.loop_radius[scan.chosen] < 0.5 < scan.loop_radius[0]
    assert str(scan).count("(taken)") == 1
    assert "radius" in str(scan).splitlines()[0]
    assert scan.fit.warnings  # what the chosen fit misses is warned of, not only tabled
    named = robust.uncertainty(bla, scan.fit)
    assert named.origin.omega_c == CROSSOVER
    assert set(scan.fit.warnings) <= set(named.warnings)


def test_without_a_crossover_an_order_is_chosen_by_the_crossover_it_allows():
    bla = measured(stage(), PRECISIONS["falling"])
    scan = scan_orders(bla, n_poles=(2, 4, 6), delay=0.0)
    assert np.isnan(scan.omega_c)
    assert scan.reach[scan.chosen] > 0.9 * scan.reach.max()
    assert scan.reach.max() > CROSSOVER / 2


def test_a_radius_above_one_below_the_crossover_is_never_without_a_word():
    bla = measured(stage(), PRECISIONS["falling"])
    fit = robust.fit_nominal(bla, n_poles=1, omega_c=2 * np.pi * 40)
    with pytest.warns(
        robust.DesignWarning, match=r"reaches .* of \|G\| below the crossover of 40 Hz.*misfit"
    ):
        robust.uncertainty(bla, fit)


@pytest.mark.parametrize(
    ("omega_c", "dt", "text"),
    [
        (2 * np.pi * 200, 0, r"omega_c must lie in the measured band, 1 Hz to 150 Hz, got 200 Hz"),
        (2 * np.pi * 0.2, 0, "omega_c must lie in the measured band"),
        (2 * np.pi * 600, 1e-3, r"omega_c must lie below the Nyquist frequency 500 Hz, got 600 Hz"),
        (-1.0, 0, "omega_c must be"),
    ],
)
def test_a_crossover_that_no_model_serves_is_refused(omega_c, dt, text):
    for bla in (
        measured(stage(), PRECISIONS["level"]),
        matrix(np.ones((2, 2, 1)) * stage(), 1e-3 * np.ones((2, 2, 1))),
    ):
        with pytest.raises(ValueError, match=text):
            robust.fit_nominal(bla, n_poles=2, omega_c=omega_c, dt=dt)


def test_a_crossover_where_the_gain_is_not_measured_is_refused():
    bla = measured(stage(), np.full(F.size, np.abs(stage()[20])))
    with pytest.raises(
        ValueError, match=r"omega_c must lie where \|G\| is above its bound, got 100 Hz"
    ):
        robust.fit_nominal(bla, n_poles=2, omega_c=2 * np.pi * 100)


def test_a_bare_frf_is_weighted_for_the_loop():
    frf = control.FrequencyResponseData(stage(), 2 * np.pi * F)
    fit = robust.fit_nominal(frf, n_poles=4, omega_c=CROSSOVER)
    assert np.abs(fit.response[F < 12] / stage()[F < 12] - 1).max() < 0.06


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_order_that_follows_the_scatter_of_a_line_is_not_taken(seed):
    """A pole and a zero that the data do not tell apart lower the radius where one noisy line is
    high, and no more.
    """
    ms = nlfrf.multisine(fs=1000, n_samples=4000, f_min=1, f_max=150, rms=0.5, rng=seed)
    record = nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2, oversampling=4)
    scan = scan_orders(nlfrf.identify(record), n_poles=range(1, 9), omega_c=2 * np.pi * 20)
    assert scan.best == 3
    assert scan.loop_radius[scan.chosen] < 1


def test_beside_a_step_of_sparse_lines_the_weight_stays_near_the_radius_that_it_covers():
    """It covers the larger neighbour from one line to the next, and below the band the first line
    alone.
    """
    f = np.array([3.0, 9, 11, 17, 19, 25, 27, 33, 41, 49, 57, 73, 81, 97, 105, 121, 137, 153])
    std = np.array([0.1, 0.23, 0.1, *np.full(15, 6e-3)])
    G = 1e3 / (2j * np.pi * f * (2j * np.pi * f + 20))
    bla = nlfrf.bla_from_frf(f, G, std=std * np.abs(G))
    model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2, omega_c=2 * np.pi * 17))
    omega = 2 * np.pi * np.linspace(1.0, 11.0, 400)
    radius = np.interp(omega, [*model.omega[:3]], model.radius[:3])
    largest = model.radius[:3].max()
    assert np.all(np.abs(model.weight(1j * omega)) < 1.25 * largest)
    assert np.all(np.abs(model.weight(1j * omega)) >= radius * (1 - 1e-9))
