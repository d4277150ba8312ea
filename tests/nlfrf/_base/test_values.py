"""Values are frozen, keyword-only, and keep their own arrays."""

import dataclasses
import pickle

import numpy as np
import pytest

from nlfrf import multisine
from nlfrf._base.values import value
from nlfrf.signals import LineGrid


@value
class Tone:
    amplitude: np.ndarray
    f: float = 1.0


@value(kw_only=False)
class Spring:
    stiffness: float


def test_arrays_are_copied_and_read_only():
    samples = np.ones(3)
    tone = Tone(amplitude=samples)
    samples[0] = 5
    assert tone.amplitude[0] == 1
    with pytest.raises(ValueError, match="read-only"):
        tone.amplitude[0] = 2


def test_a_view_of_somebody_elses_array_is_copied_too():
    samples = np.ones(4)
    view = samples[:2]
    view.flags.writeable = False
    tone = Tone(amplitude=view)
    samples[0] = 5
    assert tone.amplitude[0] == 1


def test_frozen_keyword_only_and_without_equality():
    tone = Tone(amplitude=np.ones(3))
    with pytest.raises(dataclasses.FrozenInstanceError):
        tone.f = 2.0
    with pytest.raises(TypeError):
        Tone(np.ones(3))
    assert Spring(3.0).stiffness == 3.0
    assert tone != Tone(amplitude=np.ones(3))
    assert [field.name for field in dataclasses.fields(Tone)] == ["amplitude", "f"]


def test_values_survive_pickling():
    ms = multisine(fs=64, n_samples=64, f_min=1, f_max=20, rng=1)
    again = pickle.loads(pickle.dumps(ms))
    np.testing.assert_array_equal(again.u, ms.u)
    assert isinstance(again.lines, LineGrid)


@value
class Verdict:
    words: str

    def __str__(self):
        return self.words


def test_what_a_value_prints_fits_a_screen_and_loses_no_word():
    words = "  a verdict: " + "is stable with every plant, " * 20 + "x" * 120 + " end"
    text = str(Verdict(words=f"short\n{words}"))
    rows = text.split("\n")
    assert rows[0] == "short"
    assert [row for row in rows if len(row) > 100 and "x" * 120 not in row] == []
    assert all(
        row.startswith("    ") for row in rows[2:]
    )  # what continues a line stands further in than the line
    assert text.split() == f"short {words}".split()


def test_a_command_to_copy_and_lines_that_fit_stay_as_they_are():
    words = "run:   nlfrf identify " + "very-long-name " * 12 + "\n\n  1   2\n" + "y " * 50
    assert str(Verdict(words=words)) == words
