"""Units of records, sets and controllers: where two are known and differ, they do not go
together.
"""

import sys
from dataclasses import replace

import control
import numpy as np
import pytest

import robust
from robust import cli, fit_nominal, uncertainty, validate
from robust.models import scan_orders
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


def test_a_controller_file_has_the_unit_of_its_plant(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def check(unit_of_u, unit_of_y, file):
        robust.save(uncertainty(record(unit_of_u, unit_of_y), LAG), "model.json")
        monkeypatch.setattr(sys, "argv", ["robust", "check", "model.json", file, "--no-certify"])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        printed = capsys.readouterr()
        return stop.value.code, " ".join((printed.out + printed.err).split())

    robust.save(control.tf([2.0], [1]), "K.json", delay=1e-3, unit="mm/A")
    robust.save(control.tf([2.0], [1]), "bare.json")
    for *units, file in (
        ("A", "mm", "K.json"),
        ("", "", "K.json"),
        ("", "mm", "K.json"),
        ("N", "m", "bare.json"),
    ):
        code, printed = check(*units, file)
        assert (code, "verdict:" in printed) == (1, True)  # without a certificate nothing is proved
    code, printed = check("N", "m", "K.json")
    assert code == 2
    assert "controller must be for a plant in m/N" in printed
    assert "got K.json for mm/A" in printed
    with pytest.raises(ValueError, match="delay and unit must be left out"):
        robust.save(record(), tmp_path / "bla.npz", unit="mm/A")
    with pytest.raises(ValueError, match="delay and unit must be left out"):
        robust.save(uncertainty(record(), LAG), tmp_path / "model.json", unit="mm/A")
