"""Measured machines: a fine steering mirror with piezo hysteresis (3x3), a beam with two patches
(2x2).
"""

import numpy as np
import pytest

import nlfrf


def held(frm, other):
    """Shares of the entries and of the matrices of another set that lie in the 95 % bound of this
    one.
    """
    apart = other.G - frm.G
    left, right = (np.moveaxis(side, 2, 0) for side in frm.block(of="realization"))
    Z = np.linalg.solve(left, np.moveaxis(apart, 2, 0)) @ np.linalg.inv(right)
    return np.mean(np.abs(apart) < frm.bound(of="realization")), np.mean(
        np.linalg.norm(Z, 2, (1, 2)) < 1
    )


@pytest.mark.parametrize("level", ["300mV", "100mV"])
def test_the_second_half_of_the_mirrors_sets_lies_in_the_bound_of_the_first(measured, level):
    """Floren and others, ISMA 2024, CC BY 4.0.

    A full grid: the level comes from the roughness of one set.
    """
    folder = measured / "fine_steering_mirror"
    u, y = (np.load(folder / f"{name}_{level}_train.npy").transpose(1, 2, 3, 0) for name in "uy")
    lines = nlfrf.signals.LineGrid(excited=np.arange(600, 1600))

    def matrix(sets):
        record = nlfrf.Record(u=u[:, sets], y=y[:, sets], fs=6400, lines=lines)
        with pytest.warns(nlfrf.DataWarning) as said:
            frm = nlfrf.identify(record, transient="none")
        return frm, " ".join(str(one.message) for one in said)

    (first, said), (second, _) = matrix(slice(0, 3)), matrix(slice(3, 6))
    assert ("have the same phases (psi)" in said) == (
        level == "100mV"
    )  # experiments 1 and 2 of each set
    entries, matrices = held(first, second)
    assert 0.93 < entries < 0.98
    assert 0.92 < matrices < 0.99
    noise, distortion = (
        np.median(np.einsum("jjk->k", c).real) for c in (first.cov.noise, first.cov.distortion)
    )
    assert (distortion / noise > 50) == (level == "300mV")


def test_the_beam_has_its_peaks_where_its_owner_says(measured):
    """F. Ribeiro 2015, BSD 2-clause: patches driven alike and in opposition by one sweep: no
    psi.
    """
    data = np.load(measured / "beam_ring" / "beam_ring_2x2.npz")
    lines = nlfrf.signals.LineGrid(excited=np.arange(1200, 4200))
    names = {"inputs": ("upper patch", "lower patch"), "outputs": ("upper", "lower")}
    record = nlfrf.Record(u=data["u"], y=data["y"], fs=1000, lines=lines, **names)
    with pytest.warns(nlfrf.DataWarning) as said:
        frm = nlfrf.identify(record, transient="none")
    text = " ".join(str(one.message) for one in said)
    assert "have the same phases (psi)" in text
    assert "have the same phases (phi)" in text
    size = np.abs(frm.G).max(axis=(0, 1))
    for peak in (11.2, 22.6, 28.1, 33.2):
        near = np.abs(frm.f - peak) < 1.5
        assert abs(frm.f[near][size[near].argmax()] - peak) < 0.25
    assert np.isfinite(frm.bound()).all()
