"""What works without the packages of the extras, and the one line that says which extra installs
what is missing.
"""

import subprocess
import sys

#: Put in front of a script: as if the packages of nlfrf[full] were not installed.
WITHOUT = """
import sys
from importlib import metadata
find = metadata.Distribution.from_name
def find_others(name):
    if name in ('numba', 'pandas', 'h5py'):
        raise metadata.PackageNotFoundError(name)
    return find(name)
metadata.Distribution.from_name = find_others
for name in ('numba', 'pandas', 'h5py'):
    sys.modules[name] = None
"""

CORE = """
import numpy as np, control, nlfrf, robust
ms = nlfrf.multisine(fs=128, n_samples=512, f_min=1, f_max=40, rng=1)
y = np.fft.irfft(np.fft.rfft(ms.u) / (1 + 1j * np.fft.rfftfreq(512) * 10), 512) + 0.01 * ms.u**3
record = nlfrf.Record(u=np.array([[ms.u, ms.u]]), y=np.array([[y, y]]), fs=128, lines=ms.lines)
nlfrf.save(record, "record.npz")
bla = nlfrf.identify(nlfrf.load_record("record.npz"))
model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2))
K = robust.ncfsyn(model.nominal).K
robust.reports.write_report("report.html", model, K)
print(robust.check(model, K).verdict)
"""


def run(script, folder):
    return subprocess.run(
        [sys.executable, "-c", WITHOUT + script],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_core_identifies_models_designs_checks_and_reports(tmp_path):
    found = run(CORE, tmp_path)
    assert found.returncode == 0, found.stderr
    assert "robust" in found.stdout
    assert (tmp_path / "report.html").stat().st_size > 10_000


MISSING = """
import nlfrf
ms = nlfrf.multisine(fs=1000, n_samples=1000, f_min=1, f_max=40, rng=1)
nlfrf.save(ms, "ms.npz")
for call in (
    lambda: nlfrf.load_record("run.csv", fs=10, n_samples=2),
    lambda: nlfrf.save(ms, "new.h5"),
    lambda: nlfrf.simulate(nlfrf.paper_rig(), ms),
):
    try:
        call()
    except (ValueError, ImportError) as error:
        print(error)
from nlfrf.doctor import nlfrf_command
sys.argv = ["nlfrf", "simulate", "ms.npz", "-o", "x.npz"]
nlfrf_command()
"""


def test_what_is_missing_is_named_with_its_extra(tmp_path):
    (tmp_path / "run.csv").write_text(
        "t,u,y\n" + "\n".join(f"{k / 10},{k % 2},{k % 2}" for k in range(40))
    )
    found = run(MISSING, tmp_path)
    said = found.stdout.strip().splitlines()
    assert len(said) == 3
    for line, extra in zip(said, ("csv", "hdf5", "rig"), strict=True):
        assert f"which is not installed: pip install 'nlfrf[{extra}]'" in line
    assert found.returncode == 2
    assert found.stderr.strip().splitlines()[-1] == f"nlfrf: {said[-1]}"
