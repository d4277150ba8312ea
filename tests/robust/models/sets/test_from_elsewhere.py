"""FRFs from elsewhere on their way through a fit to a set: one channel or several, the deviation
goes through.
"""

import control
import numpy as np
import pytest

import nlfrf
import robust

F = np.geomspace(1, 100, 40)
OMEGA = 2 * np.pi * F
PLANT = control.tf([1e4], [1, 20, 1e4])


def measured(seed, share=0.01):
    """A stepped sine: unequally spaced lines, with noise of a known deviation."""
    rng = np.random.default_rng(seed)
    true = PLANT(1j * OMEGA)
    std = share * np.abs(true)
    return (
        true + std * (rng.standard_normal(F.size) + 1j * rng.standard_normal(F.size)) / np.sqrt(2),
        std,
    )


def test_the_std_of_an_frf_reaches_the_set():
    G, std = measured(1)
    frf = control.FrequencyResponseData(G, OMEGA)
    fit = robust.fit_nominal(frf, n_poles=2, n_zeros=0, std=std)
    model = robust.uncertainty(robust.io.bla_from_frd(frf, std=std), fit)
    assert (model.confidence, model.perturbation) == (0.95, "statistical")
    direct = robust.uncertainty(nlfrf.bla_from_frf(F, G, std=std), fit)
    assert model.radius == pytest.approx(direct.radius, rel=1e-6)
    assert (
        "an FRF that was given, 40 lines 1 to 100 Hz, variance from its std" in model.origin.source
    )


@pytest.mark.parametrize("several", [False, True])
def test_an_frf_is_taken_with_the_fit_that_got_its_std(several):
    G, std = measured(1)
    if several:
        blocks = np.array([[1.0, 0.5], [0.5, 1.0]])[:, :, None]
        G, std = blocks * G, np.broadcast_to(std, (2, 2, F.size))
    frf = control.FrequencyResponseData(G, OMEGA)
    known = {"n_poles": 4} if several else {"n_poles": 2, "n_zeros": 0}
    fit = robust.fit_nominal(frf, std=std, **known)
    found = robust.uncertainty(frf, fit)
    wanted = robust.uncertainty(robust.io.bla_from_frd(frf, std=std), fit)
    assert found.radius == pytest.approx(wanted.radius, rel=1e-6)
    assert (found.confidence, found.origin.source) == (0.95, wanted.origin.source)


def test_an_frf_is_not_taken_with_a_deviation_that_is_not_its_own():
    """A BLA has the variance of another realisation, too, which its `std` alone does not have."""
    (G, std), (again, _) = measured(1), measured(2)
    frf = control.FrequencyResponseData(G, OMEGA)
    fit = robust.fit_nominal(frf, n_poles=2, n_zeros=0, std=std)
    of_bla = robust.fit_nominal(nlfrf.bla_from_frf(F, G, std=std), n_poles=2, n_zeros=0)
    for other, of in (
        (control.FrequencyResponseData(again, OMEGA), fit),
        (control.FrequencyResponseData(G[:-1], OMEGA[:-1]), fit),
        (frf, of_bla),
    ):
        with pytest.raises(ValueError, match="or give its std to fit_nominal"):
            robust.uncertainty(other, of)


def test_an_frf_without_a_deviation_claims_no_confidence():
    G, _ = measured(1)
    frf = control.FrequencyResponseData(G, OMEGA)
    fit = robust.fit_nominal(frf, n_poles=2, n_zeros=0)
    assert np.isnan(robust.uncertainty_of_plants([frf], fit).confidence)
    with pytest.raises(ValueError, match=r"for an FRF use nlfrf\.bla_from_frf first"):
        robust.uncertainty(frf, fit)


@pytest.mark.parametrize("n", [4, pytest.param(60, marks=pytest.mark.attack)])
def test_a_set_of_it_holds_the_next_measurement_line_by_line(n):
    """95 %, with the misfit of the fit beside: within four sigmas from below, and not all of it."""
    held = []
    for seed in range(n):
        (G, std), (again, _) = measured([seed, 0]), measured([seed, 1])
        model = robust.uncertainty(
            nlfrf.bla_from_frf(F, G, std=std), robust.frd(nlfrf.bla_from_frf(F, G, std=std))
        )
        held.append(model.distance(control.FrequencyResponseData(again, OMEGA)) < 1)
    share, sigma = np.mean(held), np.sqrt(0.95 * 0.05 / np.size(held))
    assert abs(share - 0.95) < 4 * sigma


def test_orders_validation_and_files_take_it(tmp_path):
    (G, std), (again, _) = measured(1), measured(2)
    bla, second = (nlfrf.bla_from_frf(F, one, std=std) for one in (G, again))
    assert robust.models.scan_orders(bla, n_poles=(1, 2, 3)).best == 2
    model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2, n_zeros=0))
    assert robust.validate(model, second).p_value > 1e-3
    robust.save(model, tmp_path / "model.json")
    assert robust.load(tmp_path / "model.json").radius == pytest.approx(model.radius)
    with pytest.raises(
        ValueError,
        match=(
            r"bla must be an nlfrf.Bla of one input and output, got .* nlfrf.bla_from_frf makes one"
        ),
    ):
        robust.validate(model, control.FrequencyResponseData(again, OMEGA))


def test_a_matrix_of_frfs_is_an_frm_by_its_std():
    G, std = measured(3)
    blocks = np.array([[1.0, 0.5], [0.5, 1.0]])[:, :, None]
    frf = control.FrequencyResponseData(blocks * G, OMEGA, inputs=["fx", "fy"], outputs=["x", "y"])
    deviation = np.broadcast_to(std, (2, 2, F.size))
    fit = robust.fit_nominal(frf, n_poles=4, std=deviation)
    assert (fit.inputs, fit.outputs) == (("fx", "fy"), ("x", "y"))
    model = robust.uncertainty(robust.io.bla_from_frd(frf, std=deviation), fit)
    assert (model.is_single, model.n_inputs, model.confidence) == (False, 2, 0.95)
    assert fit.std == pytest.approx(deviation)
    with pytest.raises(
        ValueError,
        match=(
            r"std must be given with an FRF of 2 inputs and 2 outputs\. Or give nlfrf\.bla_from_frf"
        ),
    ):
        robust.fit_nominal(frf, n_poles=4)


def test_friction_needs_amplitudes_that_nobody_noted():
    G, std = measured(1)
    with pytest.raises(
        ValueError,
        match=r"blas must contain the amplitude of the output, .*use BLAs from nlfrf.identify",
    ):
        robust.friction.machine_with_friction([nlfrf.bla_from_frf(F, G, std=std)] * 3)
