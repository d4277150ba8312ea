"""Units of records, sets and controllers: where two are known and differ, they do not go
together.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

import robust
from robust import fit_nominal, uncertainty, validate
from robust.models import scan_orders
from robust.reports.command import load_loops
from tests.support.bla import make_bla

LAG = control.tf([1], [1 / 30, 1])


def record(unit_of_u="", unit_of_y=""):
    bla = make_bla(
        lambda s: 30 / (s + 30), np.arange(1.0, 21), sigma_noise=0.02, sigma_distortion=0.02, rng=1
    )
    return replace(bla, input_units=(unit_of_u,), output_units=(unit_of_y,))


@pytest.mark.parametrize(
    "use",
    [
        lambda one, other: uncertainty([one, other], LAG),
        lambda one, other: fit_nominal([one, other], n_poles=1),
        lambda one, other: scan_orders([one, other], n_poles=(1,)),
        validate,
        lambda one, other: validate(uncertainty(one, LAG), other),
    ],
)
def test_records_in_other_units_do_not_go_together(use):
    with pytest.raises(
        ValueError, match=r"bla must be .*mm/A.* got .*m/N|bla must be .* got mm/A and m/N"
    ):
        use(record("A", "mm"), record("N", "m"))
    use(record("A", "µm"), record("A", "um"))
    use(record("A", "mm"), record())


def test_a_controller_file_has_the_unit_of_its_plant(tmp_path):
    path, bare = tmp_path / "K.json", tmp_path / "bare.json"
    robust.save(control.tf([2.0], [1]), path, delay=1e-3, unit="mm/A")
    robust.save(control.tf([2.0], [1]), bare)
    for unit, file in (("mm/A", path), ("", path), ("mm/1", path), ("m/N", bare)):
        assert load_loops([file], None, unit)[0][0].D[0, 0] == 2.0
    with pytest.raises(ValueError, match=r"controller must be for a plant in m/N.*K.json for mm/A"):
        load_loops([path], None, "m/N")
    with pytest.raises(ValueError, match="delay and unit must be left out"):
        robust.save(record(), tmp_path / "bla.npz", unit="mm/A")
    with pytest.raises(ValueError, match="delay and unit must be left out"):
        robust.save(uncertainty(record(), LAG), tmp_path / "model.json", unit="mm/A")
