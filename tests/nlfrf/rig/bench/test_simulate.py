"""Experiments on the rig: symmetry, steady state, and the same result whoever computes it."""

import signal
import subprocess
import sys
import warnings
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

import nlfrf
from nlfrf._base.arguments import DataWarning
from nlfrf.rig.bench.rig import Rig, paper_rig
from nlfrf.rig.bench.simulate import simulate
from nlfrf.signals.multisine import multisine


def odd(n_realizations=1, *, kind="special-odd", rms=0.25, n_samples=4096, rng=5):
    return multisine(
        kind,
        fs=4096,
        n_samples=n_samples,
        f_min=1,
        f_max=140,
        rms=rms,
        n_realizations=n_realizations,
        rng=rng,
    )


def test_record_has_the_shape_and_the_lines_of_the_experiment():
    ms = odd(3)
    record = simulate(paper_rig(), ms, n_periods=2)
    assert record.u.shape == record.y.shape == (3, 2, 4096)
    assert np.array_equal(record.u[:, 1], ms.u)
    assert record.fs == ms.fs
    assert record.lines is ms.lines


LUGRE = nlfrf.friction.LuGre(sigma0=64e3, sigma1=13, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01)


@pytest.mark.parametrize(
    "friction",
    [
        nlfrf.friction.Leuven(),
        nlfrf.friction.Leuven(curve=nlfrf.hysteresis.Exponential(64e3, 1.0)),
        LUGRE,
    ],
    ids=["tanh", "exp", "LuGre"],
)
@pytest.mark.parametrize("rms", [0.025, 0.25, 2.5])
@pytest.mark.parametrize("kind", ["odd", "odd-odd", "special-odd", "random-odd"])
def test_odd_grids_are_answered_with_half_wave_antisymmetry_to_rounding(kind, rms, friction):
    ms = odd(kind=kind, rms=rms)
    y = simulate(Rig(1.0, 80e3, friction), ms, n_discard=9).y[0, 0]
    spectrum = np.abs(np.fft.rfft(y))
    assert np.abs(y[:2048] + y[2048:]).max() < 2e-12 * y.std()
    assert spectrum[0:1024:2].max() < 1e-13 * spectrum.max()
    if kind != "odd":  # there is distortion to be seen, it is odd
        assert np.sqrt(np.mean(spectrum[ms.lines.odd] ** 2)) > 1e-4 * spectrum.max()


def test_result_does_not_depend_on_who_computes_it():
    ms, rig = odd(4, n_samples=8192), paper_rig()
    y = simulate(rig, ms).y
    for executor in (
        ThreadPoolExecutor(1),
        ThreadPoolExecutor(3),
        ProcessPoolExecutor(2, get_context("spawn")),
    ):
        with executor:
            assert np.array_equal(simulate(rig, ms, executor=executor).y, y)


@pytest.mark.attack
def test_result_is_the_same_on_a_cluster():
    distributed = pytest.importorskip("distributed")
    ms, rig = odd(4, n_samples=8192), paper_rig()
    y = simulate(rig, ms).y
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # sockets of the cluster, closed by its own time
        with (
            distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, dashboard_address=None
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            record = simulate(rig, ms, executor=client.get_executor())
    assert np.array_equal(record.y, y)


def test_progress_counts_up_to_the_total():
    seen = []
    simulate(
        paper_rig(), odd(3, n_samples=8192), progress=lambda done, total: seen.append((done, total))
    )
    assert seen == [(1, 3), (2, 3), (3, 3)]


class Dying(ThreadPoolExecutor):
    """An executor that computes three runs and breaks, as a pool does whose worker was killed."""

    def __init__(self):
        super().__init__(1)
        self.left = 3

    def submit(self, task, *args):
        if self.left == 0:
            future = Future()
            future.set_exception(BrokenExecutor("a worker was killed"))
            return future
        self.left -= 1
        future = super().submit(task, *args)
        future.result()
        return future


def test_executor_that_dies_is_named_and_what_was_done_is_kept(tmp_path):
    ms, rig = odd(5, n_samples=8192), paper_rig()
    with (
        Dying() as dying,
        pytest.raises(
            ValueError,
            match=r"executor must finish all 5 runs, got BrokenExecutor .* after \d, .* are lost",
        ),
    ):
        simulate(rig, ms, executor=dying)
    with (
        Dying() as dying,
        pytest.raises(ValueError, match=r"executor must finish all 5 runs, got .* are kept in"),
    ):
        simulate(rig, ms, executor=dying, resume=tmp_path)
    kept = len(list(tmp_path.glob("*.npz")))
    seen = []
    record = simulate(rig, ms, resume=tmp_path, progress=lambda done, total: seen.append(done))
    assert kept == 0 or seen[0] == kept
    assert len(list(tmp_path.glob("*.npz"))) == 5
    assert np.array_equal(record.y, simulate(rig, ms).y)


KILLED = """
import os, signal, sys
from nlfrf import multisine, paper_rig, simulate
ms = multisine(fs=4096, n_samples=8192, f_min=1, f_max=140, rms=0.25, n_realizations=6, rng=5)
stop = lambda done, total: os.kill(os.getpid(), signal.SIGKILL) if done == 3 else None
simulate(paper_rig(), ms, resume=sys.argv[1], progress=stop)
"""


def test_run_that_was_killed_is_resumed(tmp_path):
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path)], capture_output=True, check=False
    )
    assert killed.returncode == -signal.SIGKILL, killed.stderr.decode()
    assert len(list(tmp_path.glob("*.npz"))) == 3
    ms, seen = odd(6, n_samples=8192), []
    short, damaged, _ = sorted(
        tmp_path.glob("*.npz")
    )  # files that cannot be read are computed again
    short.write_bytes(short.read_bytes()[:1000])
    whole = damaged.read_bytes()
    version = whole.index(b"PK\x01\x02") + 6  # of ZIP that is needed to read it
    damaged.write_bytes(whole[:version] + b"\xff" + whole[version + 1 :])
    record = simulate(
        paper_rig(), ms, resume=tmp_path, progress=lambda done, total: seen.append((done, total))
    )
    assert seen == [(1, 6), (2, 6), (3, 6), (4, 6), (5, 6), (6, 6)]
    assert np.array_equal(record.y, simulate(paper_rig(), ms).y)


def test_numbers_of_numpy_are_kept_like_any_others(tmp_path):
    ms, rig, seen = odd(), replace(paper_rig(), mass=np.float32(1.0), stiffness=np.int64(80000)), []
    for _ in range(2):
        record = simulate(rig, ms, resume=tmp_path, progress=lambda done, total: seen.append(done))
        assert np.array_equal(record.y, simulate(paper_rig(), ms).y)
    assert len(list(tmp_path.glob("*.npz"))) == 1


def test_results_of_another_experiment_are_not_taken(tmp_path):
    ms, seen = odd(2, n_samples=8192), []
    simulate(paper_rig(), ms, resume=tmp_path)
    others = [
        (replace(paper_rig(), mass=1.1), ms, {}),
        (
            replace(
                paper_rig(), friction=nlfrf.friction.Leuven(curve=nlfrf.hysteresis.Tanh(60e3, 1.0))
            ),
            ms,
            {},
        ),
        (paper_rig(), odd(2, n_samples=8192, rng=6), {}),
        (paper_rig(), ms, {"oversampling": 2}),
        (paper_rig(), ms, {"n_discard": 3}),
        (paper_rig(), ms, {"hold": "zoh"}),
    ]
    for rig, excitation, options in others:
        simulate(
            rig,
            excitation,
            resume=tmp_path,
            progress=lambda done, total: seen.append(done),
            **options,
        )
    assert seen == [1, 2] * len(others)


def test_interruption_cancels_what_was_not_begun(tmp_path):
    def interrupt(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(paper_rig(), odd(40, n_samples=8192), progress=interrupt, resume=tmp_path)
    assert 1 <= len(list(tmp_path.glob("*.npz"))) < 10


def test_mass_that_never_breaks_away_is_a_constant_output_and_no_number_that_is_none():
    stuck = Rig(1.0, 80e3, nlfrf.friction.Coulomb.constant(10.0))
    with pytest.raises(ValueError, match="y must vary, got the constant 0"):
        simulate(stuck, odd(n_samples=512))


def test_a_step_that_is_not_stable_in_sliding_is_refused_with_one_that_is():
    rig, ms = replace(paper_rig(), damping=60.0), odd(rms=60.0, n_samples=2048)
    with pytest.raises(ValueError, match="oversampling must be about 4 for a stable"):
        simulate(rig, ms, n_discard=4)
    simulate(rig, ms, n_discard=4, oversampling=4)


def test_held_force_is_a_force_delayed_by_half_a_sample():
    ms = odd(rms=1e-4)
    smooth, held = (
        simulate(paper_rig(), ms, hold=hold, n_discard=4) for hold in ("band-limited", "zoh")
    )
    ratio = (np.fft.rfft(held.y[0, 0]) / np.fft.rfft(smooth.y[0, 0]))[ms.lines.excited]
    f = ms.f / ms.fs
    assert np.abs(ratio / (np.sinc(f) * np.exp(-1j * np.pi * f)) - 1).max() < 1e-5


def test_unsettled_record_is_announced():
    with pytest.warns(
        DataWarning, match=r"steady state was not reached: .* Raise n_discard above 0"
    ):
        simulate(paper_rig(), odd(), n_discard=0, n_periods=2)


def test_refusals_name_the_parameter():
    with pytest.raises(ValueError, match="n_periods must be a whole number of at least 1, got 0"):
        simulate(paper_rig(), odd(), n_periods=0)
    with pytest.raises(ValueError, match="hold must be one of 'band-limited', 'zoh', got 'foh'"):
        simulate(paper_rig(), odd(), hold="foh")
    with pytest.raises(ValueError, match="resume must be a folder, got the file"):
        simulate(paper_rig(), odd(), resume=__file__)
    coarse = multisine(fs=100, n_samples=400, f_min=1, f_max=40, rng=1)
    with pytest.raises(
        ValueError, match=r"oversampling must be at least \d+ for a stable integration step"
    ):
        simulate(paper_rig(), coarse)


def test_step_too_long_in_sliding_is_refused():
    rig = Rig(1.0, 80e3, nlfrf.friction.Leuven(n=3.0))
    with pytest.raises(
        ValueError, match=r"oversampling must be about \d+ for a stable integration step in sliding"
    ):
        simulate(rig, odd(2, rms=60.0, n_samples=2048))


@pytest.mark.filterwarnings("ignore:the integration step is coarse")
@pytest.mark.parametrize(("n", "enough"), [(1.0, 2), (2.0, 4)])
def test_step_accepted_in_sliding_is_right_and_a_longer_one_refused_with_its_name(n, enough):
    rig = Rig(1.0, 80e3, nlfrf.friction.Leuven(n=n))
    ms = multisine("odd", fs=512, n_samples=2048, f_min=1.25, f_max=143.25, rms=2.5, rng=3)
    exact = simulate(rig, ms, oversampling=32).y
    accepted = simulate(rig, ms, oversampling=enough).y
    assert np.sqrt(np.mean((accepted - exact) ** 2)) < 2e-3 * exact.std()
    with pytest.raises(
        ValueError, match=f"oversampling must be about {enough} for a stable .* in sliding"
    ):
        simulate(rig, ms, oversampling=enough // 2)


def test_numba_is_loaded_by_the_first_simulation_only():
    code = "import sys, nlfrf; print([m for m in ('numba', 'matplotlib') if m in sys.modules])"
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip()
        == "[]"
    )
