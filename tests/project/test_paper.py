"""The paper's equations on ensembles made by hand, and a short run of the whole reproduction."""

import json

import numpy as np
import pytest
from ensembles import (
    Ensemble,
    bootstrap_sigma,
    ensemble_spectra,
    find_resonance,
    frf,
    normalised_difference,
    output_linear,
    output_rms,
    output_stochastic,
    paper_multisine,
    single_experiment_coverage,
    underestimation_db,
)
from findings import SIGNALS, Finding, draw_held_values
from reproduce import format_table, reproduce

from nlfrf import Record
from nlfrf.signals import LineGrid
from tests.support.printed import unwrapped

LINES = LineGrid(excited=np.array([n for n in range(1, 400) if n % 8 in (1, 3)]))


def resonant(f):
    return 1 / (1 - (f / 20) ** 2 + 0.1j * f / 20)


def made_ensemble(m, *, scatter=0.1, detected=0.1, even=1e-7, rng=1, G=resonant):
    """Known spectra: y = G u + circular scatter on excited lines, circular noise on detection
    lines.
    """
    rng = np.random.default_rng(rng)

    def noise(n, size):
        return size * (rng.standard_normal((m, n)) + 1j * rng.standard_normal((m, n))) / np.sqrt(2)

    U, Y = np.zeros((m, 400), dtype=complex), np.zeros((m, 400), dtype=complex)
    U[:, LINES.excited] = 2 * np.exp(2j * np.pi * rng.uniform(size=(m, LINES.excited.size)))
    Y[:, LINES.excited] = U[:, LINES.excited] * G(LINES.excited * 0.25) + noise(
        LINES.excited.size, scatter
    )
    Y[:, LINES.odd] = noise(LINES.odd.size, detected)
    Y[:, LINES.even] = noise(LINES.even.size, even)
    return Ensemble(lines=LINES, f0=0.25, U=U, Y=Y)


def test_equations_give_back_what_was_put_in():
    e = made_ensemble(4000)
    G = resonant(LINES.excited * 0.25)
    assert np.allclose(output_linear(e), 2 * G, atol=5 * 0.1 / np.sqrt(4000))
    assert np.allclose(output_stochastic(e), 0.1, rtol=5 / np.sqrt(2 * 4000))
    assert np.allclose(output_rms(e, LINES.odd), 0.1, rtol=5 / np.sqrt(4000))
    assert np.allclose(output_rms(e, LINES.even), 1e-7, rtol=5 / np.sqrt(4000))
    mean, variance = frf(e)
    assert np.allclose(variance, 0.05**2 / 4000, rtol=5 / np.sqrt(4000))
    assert np.mean(np.abs(mean - G) ** 2 / variance) == pytest.approx(1, abs=5 / np.sqrt(G.size))
    assert find_resonance(e) == pytest.approx(20.0, abs=0.2)


def test_under_reading_is_that_of_the_detection_lines():
    e = made_ensemble(100, detected=0.1 / np.sqrt(3))
    sigma = bootstrap_sigma(e, underestimation_db)
    assert 0.1 < sigma < 0.5
    assert abs(underestimation_db(e) - 4.77) < 4 * sigma


def test_normalised_difference_is_one_for_one_bla_and_more_for_two():
    a, b = made_ensemble(20, rng=1), made_ensemble(20, rng=2, scatter=0.2)
    other = made_ensemble(20, rng=3, G=lambda f: resonant(f) * 1.1)
    assert normalised_difference(a, b) == pytest.approx(1, abs=5 / np.sqrt(LINES.excited.size))
    assert normalised_difference(a, other) > 3
    few = [
        normalised_difference(made_ensemble(4, rng=10 + i), made_ensemble(4, rng=90 + i))
        for i in range(40)
    ]
    assert np.mean(few) == pytest.approx(
        1, abs=0.15
    )  # corrected for variances that are estimates themselves


def test_single_experiments_cover_as_the_f_distribution_says():
    level, inside = single_experiment_coverage(made_ensemble(300), factor=1.0)
    assert level == pytest.approx(0.0, abs=0.5)
    assert inside == pytest.approx(0.95, abs=0.01)


def test_an_ensemble_is_the_spectra_of_its_record():
    ms = paper_multisine("special-odd", 1, n_realizations=2, rng=1)
    u = np.repeat(ms.u[:, np.newaxis], 2, axis=1)
    e = ensemble_spectra(Record(u=u, y=3 * u, fs=ms.fs, lines=ms.lines))
    assert ms.lines.excited[[0, 1, -1]].tolist() == [9, 11, 571]
    assert np.allclose(e.U[:, ms.lines.excited], ms.amplitude * np.exp(1j * ms.phase))
    assert np.allclose(e.Y, 3 * e.U)


@pytest.mark.parametrize("signal", SIGNALS)
def test_held_signals_have_the_same_white_spectrum(signal):
    values = draw_held_values(signal, 4000, np.random.default_rng(1))
    power = np.mean(np.abs(np.fft.rfft(values)[:, 1:-1]) ** 2, axis=0) / values.shape[1]
    assert np.allclose(power, 0.25, rtol=0.1)
    kurtosis = {"binary": 1.0, "uniform": 1.8}.get(signal, 3.0)
    assert np.mean(values**4) / np.mean(values**2) ** 2 == pytest.approx(kurtosis, rel=0.03)


@pytest.fixture(scope="module")
def short_run(tmp_path_factory):
    folder, seen = tmp_path_factory.mktemp("paper"), []
    found = reproduce(
        folder, n_realizations=10, seed=1, progress=lambda done, total: seen.append((done, total))
    )
    return folder, {finding.name: finding for finding in found}, seen


def test_short_run_has_every_finding(short_run):
    _, found, _ = short_run
    assert list(found) == ["F1", "F2", "F3", "F4", "F5a", "F5b", "F6", "R1", "S1", "S2", "S3"]
    for name in ("F1", "F2", "F3", "F4", "F5a", "F5b", "F6"):
        assert found[name].holds, found[name]
    # what ten realisations can show of the rest
    assert (
        abs(found["R1"].ours["level 1 [dB]"]) < 1.5 + 3 * found["R1"].ours["sigma at level 1 [dB]"]
    )
    assert all(0.5 < q < 1.6 for name in ("S1", "S3") for q in found[name].ours.values())
    assert found["S2"].ours["multisine and binary, normalised squared difference"] > 3


def test_short_run_writes_everything(short_run):
    folder, found, seen = short_run
    figures = ["figure3", "figure4", "figure5", "figure6", "figure7", "random_odd"]
    assert sorted(path.stem for path in folder.glob("*.png")) == figures
    assert all(path.stat().st_size > 20_000 for path in folder.glob("*.png"))
    content = json.loads((folder / "findings.json").read_text())
    assert content["n_realizations"] == 10
    assert [f["name"] for f in content["findings"]] == list(found)
    assert content["findings"][0]["ours"] == found["F1"].ours
    table = (folder / "findings.md").read_text()
    assert all(f"| {name} |" in table for name in found)
    assert seen[-1] == (seen[-1][1],) * 2
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)


def test_reproduce_refuses_bad_arguments(tmp_path):
    with pytest.raises(ValueError, match="n_realizations must be at least 10, got 2"):
        reproduce(tmp_path, n_realizations=2)
    with pytest.raises(ValueError, match="out must be a new or an empty folder, got"):
        reproduce(__file__)


def test_a_finding_is_text_on_a_terminal_and_a_row_in_markdown():
    found = Finding(
        name="F1",
        claim="A claim",
        paper="7.7 dB",
        ours={"level 1 [dB]": 1.234},
        criterion="below 2",
        holds=False,
    )
    rows = str(found).splitlines()
    assert rows[0] == "F1 DOES NOT HOLD"
    assert [row.split(":")[0] for row in rows[1:]] == ["claim", "paper", "ours", "holds if"]
    assert "|" not in unwrapped(found)
    assert "| F1 | A claim | 7.7 dB | level 1 [dB]: 1.23 | below 2 | **no** |" in format_table(
        [found], 10
    )
