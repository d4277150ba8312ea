"""The matrix of `identify` against best-linear-approximation (Python 3.12), by two interpreters through one file.

    python -m benchmarks.peers_matrix write peers.npz          # here
    python3.12 benchmarks/peers_matrix.py peer peers.npz       # with best-linear-approximation 0.1.1
    python -m benchmarks.peers_matrix compare peers.npz        # here again

Their layout is (N, n_u, n_u, R, P), their covariances (F, n_y n_u, n_y n_u) are sample covariances of vec(G), with
P - 1 and R - 1 degrees of freedom; ours pool the experiments of a set, n_u times as many. Here both are put together by
their definition, from our spectra.
"""

from __future__ import annotations

import sys
import warnings

import numpy as np

if sys.argv[1:2] != ["peer"]:
    from nlfrf.multivariable.channels import channel_spectra
    from nlfrf.multivariable.matrix_frf import matrix_frf


def write(path):
    """A record of three inputs, two outputs, four sets, three periods; a noisy input; a loop."""
    import nlfrf

    rng = np.random.default_rng(0)
    ms = nlfrf.multisine("random-odd", fs=512, n_samples=512, f_min=1, f_max=200, n_inputs=3, n_realizations=4, rng=1)
    r = np.repeat(ms.u[:, :, None], 3, axis=2)
    G, K = rng.normal(size=(2, 3)), 0.1 * rng.normal(size=(3, 2))
    noise = 0.1 * rng.standard_normal((2, *r.shape[1:]))
    y = np.einsum("ji,imps->jmps", G, r) + 0.1 * np.stack([r[0] ** 3, r[1] * r[2] ** 2]) + noise
    u_noisy = r + 0.05 * rng.standard_normal(r.shape)
    u_loop = np.einsum("ij,jmps->imps", np.linalg.inv(np.eye(3) + K @ G), r - np.einsum("ij,jmps->imps", K, noise))
    y_loop = np.einsum("ji,imps->jmps", G, u_loop) + noise
    np.savez(path, lines=ms.lines.excited, r=r, u=r, y=y, u_noisy=u_noisy, u_loop=u_loop, y_loop=y_loop)


def theirs(x, n_u, R):
    """(N, n, n_u, R, P) from (n, R n_u, P, N)."""
    n, _, P, N = x.shape
    return x.reshape(n, R, n_u, P, N).transpose(4, 0, 2, 1, 3)


def peer(path):
    """Their answers, beside the record."""
    from best_linear_approximation import robust

    data = dict(np.load(path))
    n_u, R, lines = 3, 4, data["lines"]
    x = {name: theirs(data[name], n_u, R) for name in data if name != "lines"}
    known = {"excited_bins": lines, "show_warnings": False}
    runs = {
        "known": robust.known_input(x["u"][..., 0], x["y"], 512.0, **known),
        "noisy": robust.noisy_input(x["u_noisy"], x["y"], 512.0, **known),
        "loop": robust.closed_loop(x["r"][..., 0], x["u_loop"], x["y_loop"], 512.0, **known),
    }
    for name, bla in runs.items():
        data[f"{name}_G"] = bla.G.value
        for kind in ("noise", "total"):
            cov = getattr(bla.G, kind).cov
            if cov is not None:
                data[f"{name}_{kind}"] = cov
    np.savez(path, **data)


def by_their_definition(record):
    """Covariances of vec(G): noise and total from samples of the whole matrix, over periods and over sets."""
    spectra, _ = channel_spectra(record, "none")
    frf = matrix_frf(spectra)
    R, n_u = len(frf.each), record.n_inputs
    U, dU, dY = (x[..., spectra.excited] for x in (spectra.U, spectra.dU, spectra.dY))
    noise = 0.0
    for m in range(R):
        of_set = slice(m * n_u, (m + 1) * n_u)
        dV = dY[:, of_set] - np.einsum("jif,iedf->jedf", frf.each[m], dU[:, of_set])
        dG = np.einsum("jedf,fei->fdij", dV, np.linalg.inv(np.moveaxis(U[:, of_set], 2, 0)))
        flat = dG.reshape(*dG.shape[:2], -1)  # vec: columns of G one after the other
        noise = noise + np.einsum("fda,fdb->fab", flat, flat.conj()) / R**2
    apart = np.moveaxis(frf.each - frf.G, 3, 0).swapaxes(2, 3).reshape(spectra.excited.size, R, -1)
    return {"noise": noise, "total": np.einsum("fra,frb->fab", apart, apart.conj()) / (R * (R - 1))}


def compare(path):
    """Largest relative differences: G of all three, covariances without a reference."""
    import nlfrf

    warnings.simplefilter("ignore", nlfrf.DataWarning)
    data = dict(np.load(path))
    grid = nlfrf.LineGrid(excited=data["lines"])
    signals = {"known": ("u", "y", None), "noisy": ("u_noisy", "y", None), "loop": ("u_loop", "y_loop", "r")}
    for name, (u, y, r) in signals.items():
        record = nlfrf.MultiRecord(u=data[u], y=data[y], r=None if r is None else data[r], fs=512, lines=grid)
        frm = nlfrf.identify(record, transient="none")
        found = {"G": np.abs(np.moveaxis(frm.G, 2, 0) - data[f"{name}_G"]).max() / np.abs(frm.G).max()}
        if r is None:
            for kind, own in by_their_definition(record).items():
                found[kind] = np.abs(own - data[f"{name}_{kind}"]).max() / np.abs(own).max()
        print(name, {kind: f"{error:.1e}" for kind, error in found.items()})


if __name__ == "__main__":
    {"write": write, "peer": peer, "compare": compare}[sys.argv[1]](sys.argv[2])
