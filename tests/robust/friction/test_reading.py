"""The class of friction from records: what it holds and refuses, its units, and the command with
its certificate.
"""

import json
import re
import shlex
import sys
from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import nlfrf.cli
import robust
from benchmarks.read_class import draw_case
from benchmarks.read_machine import attack_case, records_of
from robust import cli
from tests.robust.friction.test_identification import levels
from tests.support.friction_fits import identify_once
from tests.support.friction_loops import pid
from tests.support.printed import unwrapped

pytestmark = pytest.mark.usefixtures("friction_read_once")

RMS = (0.05, 0.3, 5.0)
ROTARY = {"input_units": ("Nm",), "output_units": ("rad",)}
IN_METRES = re.compile(r"kN/m|\bkg\b(?! m\^2)|Ns/m|\bum\b|\d m\b|\bN\b")


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """1 kg on 80 kN/m with elements of 64 kN/m and 1 N: sticking, bending, sliding.

    As they are in their files, so that what a command reads of these was read before.
    """
    folder = tmp_path_factory.mktemp("records")
    for name, record in zip("abc", levels(RMS, n_samples=1024), strict=True):
        nlfrf.save(record, folder / f"{name}.npz")
    return [nlfrf.load(folder / f"{name}.npz") for name in "abc"]


@pytest.fixture(scope="module")
def found(records):
    return robust.friction.machine_with_friction(records)


def test_the_class_of_records_holds_the_machine(found):
    """From below the spring of 80 kN/m to above all of 144 kN/m, and the mass."""
    assert 79e3 < found.stiffness_low < 80e3
    assert 144e3 < found.stiffness_low + found.friction[0].K0 < 1.02 * (80e3 + 1.25 * 64e3)
    assert found.machine.B_port[1] == pytest.approx(1.0, abs=4.5 * found.mass_std)
    assert found.machine.delay == pytest.approx(0.0, abs=1e-5)


def test_the_evidence_says_what_was_read_how_and_how_surely(found):
    said = unwrapped(found)
    assert "identified from 3 records of 0.05 to 5 N rms" in said
    assert "in intervals of 95 % each: m = " in said
    assert "1.25 times the upper end" in said
    assert re.search(r"no element slips below [\d.]+ um and none sticks at \d+ um", said)
    assert "they do not prove it" in said


def test_a_margin_is_on_the_upper_end(records, found):
    """K0 = margin times the upper end, plus the reduction of k."""
    fit = identify_once(records)
    for margin in (1.0, 2.0):
        K0 = robust.friction.machine_with_friction(fit, margin=margin).friction[0].K0
        assert (
            pytest.approx(margin * fit.interval("K0")[1] + fit.stiffness - found.stiffness_low)
            == K0
        )
    with pytest.raises(ValueError, match=r"margin must be at least 1, got 0\.9"):
        robust.friction.machine_with_friction(fit, margin=0.9)


def test_an_axis_that_turns_is_read_in_its_own_units(records):
    turned = [replace(record, **ROTARY) for record in records]
    read = robust.friction.machine_with_friction(turned)
    assert (read.machine.position_unit, read.friction[0].position_unit) == ("rad", "rad")
    proof = robust.prove_friction(read.machine, pid(20e3, 3e5, 60.0), read.friction)
    for text in (read, proof):
        assert "kNm/rad" in unwrapped(text)
        assert not IN_METRES.search(unwrapped(text))


def test_levels_of_one_axis_have_one_unit(records):
    with pytest.raises(
        ValueError, match="records must be of one axis, got positions in m and in rad"
    ):
        robust.friction.machine_with_friction(
            [records[0], records[1], replace(records[2], **ROTARY)]
        )


def test_what_makes_no_class_is_refused(records):
    blas = [nlfrf.identify(record) for record in records]
    with pytest.raises(ValueError, match="blas must be BLAs alone or Records alone, got 2 and 1"):
        robust.friction.machine_with_friction([*blas[:2], records[2]])
    with pytest.raises(
        ValueError, match="nominal must be left out with Records, for which one or two masses"
    ):
        robust.friction.machine_with_friction(records, nominal=control.tf([1], [1, 2, 8e4]))
    with pytest.raises(ValueError, match="free must be left out with BLAs"):
        robust.friction.machine_with_friction(blas, free=True)
    with pytest.raises(ValueError, match="records must hold at least three levels"):
        robust.friction.machine_with_friction(records[:2])
    with pytest.raises(
        ValueError,
        match="blas must be BLAs with one input and output, or Records, in a list, got 1",
    ):
        robust.friction.machine_with_friction(1.0)


def test_a_spring_that_a_free_axis_cannot_have_leaves_K0_open():
    """What never slips of a free axis is friction: the class was made of its elements, without 109
    of 144 kN/m.
    """
    stuck = levels((0.02, 0.05, 0.1))
    fit = robust.friction.identify_friction(stuck, free=True)
    assert np.isinf(fit.stds["K0"])
    with pytest.raises(ValueError, match=r"1\.\d+e\+05 N/m never slip"):
        robust.friction.machine_with_friction(stuck, free=True)


def test_an_element_between_two_swings_is_no_spring_of_the_machine():
    """The highest level swings beyond one of its two elements: k was read a quarter of K0 too
    high.
    """
    case = draw_case(160, seed=1)
    swings = records_of(case, 160, (0.04, 0.12, 0.6))
    with pytest.raises(
        ValueError,
        match=r"the highest level still sticks: .* of Fs breaks away beyond 0\.2 of that",
    ):
        robust.friction.machine_with_friction(swings)


def test_records_in_motion_among_those_at_rest_are_refused():
    """In motion friction is a constant force, which the measured swing does not show."""
    axis = nlfrf.servo_axis("linear motor")
    grid = {"fs": 4000, "n_samples": 4000, "f_min": 2, "f_max": 300}
    played = [
        nlfrf.multisine("special-odd", rms=rms, rng=i, **grid) for i, rms in enumerate((1, 15, 20))
    ]
    still = [nlfrf.rig.simulate_servo(axis, ms, n_periods=3, n_discard=2) for ms in played[:2]]
    moving = nlfrf.rig.simulate_servo(axis, played[2], base_velocity=0.1, n_periods=3, n_discard=1)
    with pytest.raises(
        ValueError, match=r"fit must determine .* one mass with Maxwell slip leaves"
    ):
        robust.friction.machine_with_friction([*still, moving], free=True)


@pytest.mark.attack
def test_what_the_class_proves_is_not_refuted_by_the_truth():
    """Two machines of `benchmarks.read_machine --attack`, six loops each."""
    counts = [attack_case(number, 6) for number in (5, 10)]
    assert sum(count.false for count in counts) == 0
    assert sum(count.refuted for count in counts) > 2
    assert sum(count.proved for count in counts) > 2


@pytest.fixture
def run(records, monkeypatch, capsys, tmp_path):
    """Run a command in a folder of records, traces as tables, BLAs and a controller."""
    monkeypatch.chdir(tmp_path)
    for name, record in zip(("low", "mid", "high"), records, strict=True):
        nlfrf.save(record, f"{name}.npz")
        nlfrf.save(nlfrf.identify(record), f"{name}-known.npz")
        columns = [record.u.ravel(), record.y.ravel()]
        np.savetxt(
            f"{name}.csv",
            np.transpose(columns),
            delimiter=",",
            header="force [N],place [m]",
            comments="",
        )
    robust.save(pid(20e3, 3e5, 60.0), "K.json")

    def run(line):
        program = shlex.split(line)
        monkeypatch.setattr(sys, "argv", program)
        main = {"robust": cli.main, "nlfrf": nlfrf.cli.main}[program[0]]
        with pytest.raises(SystemExit) as stop:
            main()
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    return run


def test_the_command_proves_from_records(run, tmp_path):
    code, out, err = run("robust prove low.npz mid.npz high.npz K.json --stiction 1.2 -o proof.txt")
    assert code == 0, err
    assert "identified from 3 records of 0.05 to 5 N rms" in unwrapped(out)
    assert "proved: Comes to rest from every state" in unwrapped(out)
    assert robust.io.verify_certificate("proof.certificate.json").verified
    assert run("robust verify proof.certificate.json --controller K.json")[0] == 0
    source = json.loads((tmp_path / "proof.certificate.json").read_text())["read from"]
    assert [(one["file"], one["kind"]) for one in source["files"]] == [
        (f"{name}.npz", "record") for name in ("low", "mid", "high")
    ]
    assert all(re.fullmatch("[0-9a-f]{64}", one["sha256"]) for one in source["files"])
    assert "in intervals of 95 % each" in source["evidence"]
    certificate = tmp_path / "proof.certificate.json"
    certificate.write_text(certificate.read_text().replace('"kind": "record"', '"kind": "BLA"'))
    with pytest.raises(ValueError, match="whose digest does not fit"):
        robust.io.verify_certificate(certificate)


def test_the_command_reads_traces_by_the_options_of_identify(run, tmp_path):
    given = "--input force --output place --fs 1024 --period 1024 --hold band-limited"
    code, out, err = run(
        f"robust prove low.csv mid.csv high.csv K.json --stiction 1.2 {given} -o proof.txt"
    )
    assert code == 0, err
    assert "identified from 3 records of 0.05 to 5 N rms" in unwrapped(out)
    source = json.loads((tmp_path / "proof.certificate.json").read_text())["read from"]["files"][0]
    assert source["options"] == {
        "--input": "force",
        "--output": "place",
        "--fs": "1024.0",
        "--period": "1024",
        "--hold": "band-limited",
    }
    assert robust.io.verify_certificate("proof.certificate.json").verified


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (
            "low.npz mid.npz high-known.npz K.json",
            "BLAs alone or records alone, got the BLAs high-known.npz and the",
        ),
        (
            "low.npz mid.npz K.json --stiffness 8e4",
            "records at three levels, from sticking to sliding, got 2 records",
        ),
        (
            "low-known.npz mid-known.npz high-known.npz K.json --fs 1024 --free",
            "must be records for --fs and --free, got BLAs",
        ),
    ],
)
def test_whoever_follows_a_refusal_gets_a_verdict(run, asked, message):
    code, _, err = run(f"robust prove {asked}")
    assert code == 2
    assert message in unwrapped(err)
    for line in unwrapped(err).split("go on with: ")[-1].strip().split("; "):
        code, out, err = run(line)
        assert code in (0, 1), (line, err)
    assert "proved" in out or "decided" in out


def test_a_nominal_is_for_BLAs(run):
    code, _, err = run("robust prove low.npz mid.npz high.npz K.json --nominal m.json")
    assert code == 2
    assert (
        "nominal must be left out with records, which are read as one mass with a delay"
        in unwrapped(err)
    )
    assert "nlfrf identify low.npz -o low-bla.npz" in unwrapped(err)
