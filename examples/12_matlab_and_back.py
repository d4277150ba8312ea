"""
12. Export to MATLAB and back
=============================

A colleague works in MATLAB. The model is exported as plain structs, with a loader that makes the
uncertain plant (``ultidyn``). The colleague returns a controller as A, B, C, D in a ``.mat`` file,
which is checked here. All numbers are equal to the bit. If GNU Octave is installed, it plays the
colleague.
"""

import argparse
import shutil
import subprocess
from pathlib import Path
from textwrap import fill

import control
import matplotlib.pyplot as plt
import numpy as np
from scipy.io import loadmat, savemat

import nlfrf
import robust
from robust.lti.lti import response
from robust.plot import plot_check, plot_loop

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/12"), help="folder for the files")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

# %%
# The model in every kind of file.
ms = nlfrf.multisine(fs=2048, n_samples=8192, f_min=1, f_max=150, rms=0.25, rng=1)
record = nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2)
bla = nlfrf.identify(record)
model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=3), order=4)
robust.io.export_matlab(model, out / "plant.mat")
robust.save(model, out / "plant.json")
nlfrf.export_csv(bla, out / "bla.csv")
print("in MATLAB:  [Gu, G, W, model] = load_plant();  robstab(feedback(Gu, K))")

# %%
# Back from the file: the same numbers, to the bit.
content = loadmat(out / "plant.mat", struct_as_record=False, squeeze_me=True)["content"]
print(fill(f"plant.mat: {', '.join(content._fieldnames)}", 100))
matrices = [
    np.reshape(getattr(content.nominal, m), getattr(model.nominal, m).shape) for m in "ABCD"
]
nominal = control.ss(*matrices)
same = np.array_equal(content.freq, model.omega) and np.array_equal(
    content.response, model.at(model.omega)
)
print(f"frequencies and response equal to the bit: {same}")
print(
    "nominal rebuilt, largest difference:"
    f" {np.abs(response(nominal, model.omega) - content.response).max():g}"
)
weight = robust.load(out / "plant.json").weight
same = all(np.array_equal(getattr(weight, m), getattr(model.weight, m)) for m in "ABCD")
print(f"plant.json: weight equal to the bit: {same}")

# %%
# The colleague's turn. In Octave, without any toolbox: the response of the nominal from its A, B,
# C, D on the lines of the file, and an integrating controller of their own.
script = """
data = load('plant.mat'); m = data.content; n = m.nominal;
G = arrayfun(@(w) n.C * ((1i * w * eye(rows(n.A)) - n.A) \\ n.B) + n.D, m.freq);
apart = max(abs(G - m.response) ./ abs(m.response));
printf('Octave: %d lines, largest difference %.1g of the response\\n', numel(G), apart);
Ts = 1e-3; A = 1; B = 1; C = 2 * pi * 2 * Ts / abs(m.response(1)); D = C / 2;
save('-v7', 'controller_from_octave.mat', 'A', 'B', 'C', 'D', 'Ts');
"""
if shutil.which("octave"):
    done = subprocess.run(
        ["octave", "--quiet", "--eval", script], cwd=out, capture_output=True, text=True, check=True
    )
    print(done.stdout.strip())
else:
    print("Octave is not installed: the same file is written by SciPy instead")
    gain = 2 * np.pi * 2 * 1e-3 / np.abs(content.response[0])
    savemat(
        out / "controller_from_octave.mat",
        {"A": 1.0, "B": 1.0, "C": gain, "D": gain / 2, "Ts": 1e-3},
    )

# %%
# The returned controller is checked like any other.
sent = loadmat(out / "controller_from_octave.mat")
K = control.ss(*(sent[m] for m in "ABCD"), float(sent["Ts"].squeeze()))
report = robust.check(model, K, w_P=robust.performance_weight(2 * np.pi * 0.5, M_S=2.5, A=1e-2))
print(report.summary)
robust.save(K, out / "controller.json", delay=0.0)
robust.io.export_matlab(K, out / "controller.mat")
print(
    "second-order sections for the target, b0 b1 b2 a0 a1 a2:",
    robust.io.controller_sections(K).round(4).tolist(),
)

figure, (left, right) = plt.subplots(1, 2, figsize=(15, 5), layout="constrained")
plot_loop(report, ax=left)
plot_check(report, ax=right)
figure.savefig(out / "loop.png", dpi=90)
print(fill(f"wrote {', '.join(sorted(p.name for p in out.iterdir()))}", 100))
