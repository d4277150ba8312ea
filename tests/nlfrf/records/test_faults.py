"""Every fault of the table in the documentation, injected: it is said with its numbers, and what
the cure leaves.
"""

import re
from pathlib import Path

import numpy as np
import pytest

import nlfrf
from benchmarks import faults

GUIDE = Path(__file__).parents[3] / "docs" / "guide" / "faults.md"


@pytest.mark.parametrize(
    "fault", faults.FAULTS, ids=[f"{fault.on}: {fault.name}" for fault in faults.FAULTS]
)
def test_fault_is_named_and_cured(fault):
    found = faults.outcome(fault)
    assert re.search(fault.said, found.said), found.said
    assert found.refused == fault.refused
    if fault.cure is not None:
        assert found.error < 1.5e-3  # noise leaves 2e-4
        assert found.held > 0.9


def test_the_guide_has_every_fault():
    rows = [
        [cell.strip() for cell in line.split("|")]
        for line in GUIDE.read_text().splitlines()
        if line[:2] == "| "
    ]
    named = {(row[1], row[2]) for row in rows}
    assert len(faults.FAULTS) >= 25
    assert {(fault.on, fault.name) for fault in faults.FAULTS} <= named


def test_a_sound_output_passes_without_a_word():
    for seed in range(10):
        _, u, y = faults.sound(seed)
        rng = np.random.default_rng(seed)
        for noise in (0.0, 1e-3, 0.1, 1.0):
            arguments = faults.cut(u, y + noise * np.std(y) * rng.standard_normal(y.size), seed)
            nlfrf.record_from_samples(**arguments)


@pytest.mark.parametrize("damping", [0.3, 0.02, 0.002])
def test_a_transient_is_not_taken_for_a_fault(damping):
    ms, u, y = faults.sound()
    w, t = 2 * np.pi * 60, np.arange(y.size) / faults.FS
    y = y + 2 * np.std(y) * np.exp(-damping * w * t) * np.cos(w * t)
    for n in (2, 3, 8):
        for noise in (0.0, 1e-3):
            y = y + noise * np.random.default_rng(n).standard_normal(y.size)
            periods = slice(0, n * faults.N)
            record = nlfrf.record_from_samples(
                u[periods], y[periods], fs=faults.FS, n_samples=faults.N, lines=ms.lines
            )
            assert record.n_periods >= n - 1


def test_coverage_of_a_record_that_lost_a_sample_of_y_is_restored():
    """Without the cure one lost sample leaves the 95 % bound of the true FRF holding a few lines in
    ten.
    """
    k = np.arange(faults.N // 2 + 1)
    s, w = 2j * np.pi * k * faults.FS / faults.N, 2 * np.pi * 60
    held, before = [], []
    for seed in range(4):
        ms, u, y = faults.sound(seed)
        plant = (1 / (1 + 0.04 * s / w + (s / w) ** 2))[ms.lines.excited]
        linear = np.fft.irfft(np.fft.rfft(ms.u[0]) / (1 + 0.04 * s / w + (s / w) ** 2))
        y = faults.noisy(np.tile(linear, faults.P + 2), seed)
        arguments = faults.cut(u, y) | {"y": np.delete(y, 7300 + seed)[: faults.P * faults.N]}
        bla = nlfrf.identify(nlfrf.record_from_samples(**arguments, resample=True))
        held.append(np.abs(bla.G - plant) < bla.bound())
        shape = (1, faults.P, faults.N)
        raw = nlfrf.Record(
            u=arguments["u"].reshape(shape),
            y=arguments["y"].reshape(shape),
            fs=1000,
            lines=ms.lines,
        )
        bla = nlfrf.identify(raw)
        before.append(np.abs(bla.G - plant) < bla.bound())
    assert np.mean(before) < 0.6
    assert 0.92 < np.mean(held) < 0.998


def test_a_force_that_drops_at_the_resonance_is_no_stranger():
    """A shaker gives way: the measured force is small there, and scatters from line to line and run
    to run.
    """
    for seed in range(10):
        rng = np.random.default_rng(seed)
        ms = nlfrf.multisine(
            "odd", fs=1024, n_samples=1024, f_min=40, f_max=60, n_realizations=4, rng=rng
        )
        x = np.arange(513) / 50
        drop = 1 - x**2 + 0.04j * x
        U = np.fft.rfft(ms.u, axis=1) * drop / np.abs(drop[ms.lines.excited]).max()
        scatter = rng.standard_normal((2, *U.shape)) * 0.1 * np.abs(U).max()
        u = np.fft.irfft(U + scatter[0] + 1j * scatter[1], 1024, axis=1)[:, None]
        bla = nlfrf.identify(
            nlfrf.Record(u=u, y=2 * u, fs=1024, lines=ms.lines), level_from="roughness"
        )
        assert np.allclose(bla.G, 2)
        stranger = u * np.array([1, 1, 1, 10])[:, None, None]
        with pytest.raises(
            ValueError, match="must have the same amplitude spectrum in every realisation"
        ):
            nlfrf.identify(
                nlfrf.Record(u=stranger, y=u, fs=1024, lines=ms.lines), level_from="roughness"
            )
