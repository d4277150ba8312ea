"""A second matrix: the same machine is taken for the same, a changed one for changed, with the
probabilities stated.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import robust
from tests.support.printed import unwrapped

BAND = {"fs": 512, "n_samples": 512, "f_min": 1, "f_max": 200}
G0 = np.array([[1.0, 0.3], [-0.5, 2.0]])


def matrix(rng, change=None, *, noise=0.03, n_inputs=2, kind="random-odd", **more):
    """An `Bla` of two first-order lags, mixed, in white noise."""
    generator = np.random.default_rng(rng)
    ms = nlfrf.multisine(kind, **BAND, n_inputs=n_inputs, rng=rng, **more)
    G = lags(ms.f) if change is None else change(ms.f)
    U = np.fft.rfft(ms.u, axis=2)
    Y = np.zeros_like(U)
    Y[..., ms.lines.excited] = np.einsum("jif,imf->jmf", G, U[..., ms.lines.excited])
    y = np.repeat(np.fft.irfft(Y, 512, axis=2)[:, :, None], 2, axis=2)
    record = nlfrf.Record(
        u=np.repeat(ms.u[:, :, None], 2, axis=2),
        y=y + noise * generator.standard_normal(y.shape),
        fs=512,
        lines=ms.lines,
    )
    return nlfrf.identify(record, transient="none")


def lags(f, gain=1.0, delay=0.0, ratio=1.0):
    """(2, 2, F) both axes behind a lag of 50 Hz."""
    return gain * G0[:, :, None] / (1 + 1j * f / ratio / 50.0) * np.exp(-2j * np.pi * f * delay)


def test_two_records_of_one_machine():
    """40 pairs of linear machines in white noise on grids of their own: shares and p-values are
    those stated.
    """
    seen = [robust.validate(matrix(2 * e), matrix(2 * e + 1)) for e in range(40)]
    lines = seen[0].n_lines
    # windows share lines and a level weighs pairs: the tolerance is that of a fifth of the lines
    sigma = np.sqrt(0.05 * 0.95 / (40 * lines / 5))
    assert abs(np.mean([one.n_outside / one.n_lines for one in seen]) - 0.05) < 4 * sigma
    assert abs(np.mean([one.entries_outside / one.n_lines for one in seen]) - 0.05) < 4 * sigma
    for p in (0.1, 0.5):
        share = np.mean([one.p_value < p for one in seen])
        assert abs(share - p) < 4 * np.sqrt(p * (1 - p) / 40)
        each = np.mean([one.p_values < p for one in seen], axis=0)
        assert np.all(np.abs(each - p) < 4 * np.sqrt(p * (1 - p) / 40))
    assert 0.9 < np.median([one.change.level for one in seen]) < 1.1


@pytest.mark.parametrize(
    ("change", "name", "size"), [({"gain": 1.05}, "gain", 0.05), ({"delay": 1e-4}, "delay", 1e-4)]
)
def test_a_change_that_all_entries_share_is_found(change, name, size):
    found = [
        robust.validate(matrix(2 * e), matrix(2 * e + 1, lambda f: lags(f, **change)))
        for e in range(10)
    ]
    assert max(one.p_value for one in found) < 0.01
    assert np.mean([getattr(one.change, name) for one in found]) == pytest.approx(size, rel=0.15)


def test_one_entry_that_changed_is_named():
    def one_entry(f):
        G = lags(f)
        G[0, 1] *= 1.5
        return G

    seen = robust.validate(matrix(1), matrix(2, one_entry))
    assert seen.p_values[0, 1] < 1e-6
    assert np.sort(seen.p_values.ravel())[1] > 1e-3
    assert seen.entries_outside[0, 1] > 3 * seen.n_expected
    assert "the entry that changed most: y1 by u2" in unwrapped(seen)


def test_noise_of_the_second_record_counts():
    """The other way round as well: a quiet record says nothing against a noisy one."""
    quiet, loud = matrix(1, noise=0.01), matrix(2, noise=0.1)
    for one, other in ((quiet, loud), (loud, quiet)):
        seen = robust.validate(one, other)
        assert seen.n_outside < 3 * seen.n_expected
        assert 0.8 < seen.change.level < 1.25


@pytest.mark.parametrize("form", ["additive", "auto"])
def test_a_set_from_a_file_remembers_its_record(form, tmp_path):
    frm, other = matrix(1), matrix(2)
    nominal = control.append(*[control.ss(control.tf([1.0], [1 / (2 * np.pi * 50), 1.0]))] * 2)
    model = robust.uncertainty(
        frm, control.ss(nominal.A, nominal.B, G0 @ nominal.C, np.zeros((2, 2))), form=form
    )
    robust.save(model, tmp_path / "m.json")
    back = robust.load(tmp_path / "m.json")
    assert robust.validate(back, frm).p_value == 1.0
    kept, read = robust.validate(model, other), robust.validate(back, other)
    assert (read.p_value, read.n_outside) == (kept.p_value, kept.n_outside)
    np.testing.assert_array_equal(read.p_values, kept.p_values)
    robust.save(back, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "m.json").read_bytes()


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("form", ["additive", "elements", "input"])
def test_a_record_held_against_a_set(form):
    frm = matrix(1)
    nominal = control.tf2ss([1.0], [1 / (2 * np.pi * 50), 1.0])
    lag = control.append(nominal, nominal)
    G = control.ss(lag.A, lag.B, G0 @ lag.C, np.zeros((2, 2)))
    model = robust.uncertainty(frm, G, form=form, order=2)
    seen = robust.validate(model, frm)
    assert (seen.p_value, seen.n_outside, seen.n_lines) == (1.0, 0, frm.f.size)
    new = robust.validate(model, matrix(2))
    assert np.mean(new.distance > 1) < 0.15
    far = robust.validate(model, matrix(3, lambda f: lags(f, gain=1.5)))
    assert far.n_outside_set > 0.9 * far.n_lines
    assert far.p_value < 1e-6
    assert f"{far.n_outside_set} outside the set, worst at" in unwrapped(far)
    # a set whose record is not known: its nominal is taken as exact
    exact = robust.validate(replace(model, records=()), matrix(2))
    assert exact.p_value > 1e-3


def test_channels_in_another_order_are_refused():
    """They were compared by their places: 70 of 114 lines outside, of the same machine."""
    frm = replace(matrix(1), inputs=("fx", "fy"), outputs=("x", "y"))
    lag = control.tf2ss([1.0], [1 / (2 * np.pi * 50), 1.0])
    both = control.append(lag, lag)
    model = robust.uncertainty(
        frm, control.ss(both.A, both.B, G0 @ both.C, np.zeros((2, 2))), form="elements", order=2
    )
    for first in (frm, model):
        robust.validate(
            first, replace(matrix(2), inputs=("fx", "fy"))
        )  # outputs without names of their own
        for name, now in (("inputs", ("fy", "fx")), ("outputs", ("y", "x"))):
            with pytest.raises(
                ValueError, match=f"bla must be a matrix of the same {name} as the model, "
            ):
                robust.validate(first, replace(frm, **{name: now}))


def test_the_fit_of_channels_in_another_order_is_refused():
    """The nominal of one input stood under the record of another, and the set was as wide as both
    differ.
    """
    frm = replace(matrix(1), inputs=("fx", "fy"), outputs=("x", "y"))
    fit = robust.fit_nominal(frm, n_poles=2)
    assert (fit.inputs, fit.outputs) == (("fx", "fy"), ("x", "y"))
    robust.uncertainty(matrix(2), fit, form="elements", order=1)
    for name, now in (("inputs", ("fy", "fx")), ("outputs", ("y", "x"))):
        with pytest.raises(
            ValueError, match=f"bla must be a matrix of the same {name} as its nominal, "
        ):
            robust.uncertainty(replace(frm, **{name: now}), fit, form="elements", order=1)


def test_refusals():
    frm = matrix(1)
    with pytest.raises(
        ValueError, match=r"bla must be an nlfrf.Bla of several inputs or outputs, got"
    ):
        robust.validate(frm, frm.entry(0, 0))
    with pytest.raises(
        ValueError, match="bla must have lines inside the band of the model, got none"
    ):
        robust.validate(frm, replace(frm, f=frm.f + 1e3))
    other = nlfrf.multisine("random-odd", **BAND, n_inputs=3, rng=1)
    u = np.repeat(other.u[:, :, None], 2, axis=2)
    three = nlfrf.identify(nlfrf.Record(u=u, y=u[:2] + 0.01 * u[1:], fs=512, lines=other.lines))
    with pytest.raises(
        ValueError, match="bla must have 2 outputs and 2 inputs, as the model, got 2 and 3"
    ):
        robust.validate(frm, three)


@pytest.mark.parametrize("level", ["300mV", "100mV"])
def test_the_halves_of_the_mirrors_sets_agree_both_ways(measured, level):
    """At 100 mV two experiments of the first half were disturbed: its noise is thirty times that of
    the second half.
    """
    folder = measured / "fine_steering_mirror"
    u, y = (np.load(folder / f"{name}_{level}_train.npy").transpose(1, 2, 3, 0) for name in "uy")
    lines = nlfrf.signals.LineGrid(excited=np.arange(1600, 2600))
    halves = []
    for sets in (slice(0, 3), slice(3, 6)):
        record = nlfrf.Record(u=u[:, sets], y=y[:, sets], fs=6400, lines=lines)
        with pytest.warns(nlfrf.DataWarning) as said:
            halves.append(nlfrf.identify(record, transient="none"))
        disturbed = any("experiment 3 of 3 scatters" in str(one.message) for one in said)
        assert disturbed == (level == "100mV" and sets.start == 0)
    for one, other in (halves, halves[::-1]):
        seen = robust.validate(one, other)
        assert 0.005 < seen.n_outside / seen.n_lines < 0.08
        assert 0.03 < np.mean(seen.entries_outside / seen.n_lines) < 0.07
