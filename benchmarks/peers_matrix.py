"""The matrix of `identify` against best-linear-approximation (Python 3.12 or later), where it is
installed.

    python -m benchmarks.peers_matrix

Largest relative differences of G with a known input, a noisy one and in a loop, and of the
covariances of vec(G) where they give one. Their layout is (N, n_u, n_u, R, P), their covariances
(F, n_y n_u, n_y n_u) are sample covariances with P - 1 and R - 1 degrees of freedom; ours pool the
experiments of a set, n_u times as many. Here both are put together by their definition, from our
spectra.
"""

from __future__ import annotations

import warnings

import numpy as np

import nlfrf
from nlfrf.bla.frf import estimate_frm
from nlfrf.bla.line_index import index_lines
from nlfrf.bla.spectra import period_spectra

SETS = 4


def records():
    """Three inputs, two outputs, four sets, three periods: the input known, noisy, and in a
    loop.
    """
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(
        "random-odd",
        fs=512,
        n_samples=512,
        f_min=1,
        f_max=200,
        n_inputs=3,
        n_realizations=SETS,
        rng=1,
    )
    r = np.repeat(ms.u[:, :, None], 3, axis=2)
    G, K = rng.normal(size=(2, 3)), 0.1 * rng.normal(size=(3, 2))
    noise = 0.1 * rng.standard_normal((2, *r.shape[1:]))
    y = np.einsum("ji,imps->jmps", G, r) + 0.1 * np.stack([r[0] ** 3, r[1] * r[2] ** 2]) + noise
    noisy = r + 0.05 * rng.standard_normal(r.shape)
    u_loop = np.einsum(
        "ij,jmps->imps", np.linalg.inv(np.eye(3) + K @ G), r - np.einsum("ij,jmps->imps", K, noise)
    )
    y_loop = np.einsum("ji,imps->jmps", G, u_loop) + noise
    grid = nlfrf.signals.LineGrid(excited=ms.lines.excited)
    signals = {"known": (r, y, None), "noisy": (noisy, y, None), "loop": (u_loop, y_loop, r)}
    return {
        name: nlfrf.Record(u=u, y=y, r=r, fs=512, lines=grid) for name, (u, y, r) in signals.items()
    }


def theirs(x):
    """(N, n, n_u, R, P) from (n, R n_u, P, N)."""
    n, m, P, N = x.shape
    return x.reshape(n, SETS, m // SETS, P, N).transpose(4, 0, 2, 1, 3)


def peer(name, record):
    """Their answer."""
    from best_linear_approximation import robust

    u, y = theirs(record.u), theirs(record.y)
    known = {"excited_bins": record.lines.excited, "show_warnings": False}
    if name == "loop":
        return robust.closed_loop(theirs(record.r)[..., 0], u, y, 512.0, **known).G
    if name == "noisy":
        return robust.noisy_input(u, y, 512.0, **known).G
    return robust.known_input(u[..., 0], y, 512.0, **known).G


def by_their_definition(record):
    """Covariances of vec(G): noise and total from samples of the whole matrix, over periods and
    over sets.
    """
    spectra, _ = period_spectra(record, index_lines(record.lines))
    excited = spectra.select_excited()
    frm = estimate_frm(excited)
    R, n_u = len(frm.G_each), record.n_inputs
    U, dU, dY = excited.U, excited.dU, excited.dY
    noise = 0.0
    for m in range(R):
        of_set = slice(m * n_u, (m + 1) * n_u)
        dV = dY[:, of_set] - np.einsum("jif,iedf->jedf", frm.G_each[m], dU[:, of_set])
        dG = np.einsum("jedf,fei->fdij", dV, np.linalg.inv(np.moveaxis(U[:, of_set], 2, 0)))
        flat = dG.reshape(*dG.shape[:2], -1)  # vec: columns of G one after the other
        noise = noise + np.einsum("fda,fdb->fab", flat, flat.conj()) / R**2
    apart = np.moveaxis(frm.G_each - frm.G, 3, 0).swapaxes(2, 3).reshape(excited.lines.size, R, -1)
    return {"noise": noise, "total": np.einsum("fra,frb->fab", apart, apart.conj()) / (R * (R - 1))}


def main():
    """Print the differences."""
    warnings.simplefilter("ignore", nlfrf.DataWarning)
    print("the matrix of three inputs and two outputs against best-linear-approximation")
    try:
        import best_linear_approximation  # noqa: F401
    except ImportError:
        print("  it is not installed here (it needs Python 3.12)")
        return
    for name, record in records().items():
        frm, other = nlfrf.identify(record, transient="none"), peer(name, record)
        found = {"G": np.abs(np.moveaxis(frm.G, 2, 0) - other.value).max() / np.abs(frm.G).max()}
        if record.r is None:
            for kind, own in by_their_definition(record).items():
                found[kind] = np.abs(own - getattr(other, kind).cov).max() / np.abs(own).max()
        print(f"  {name}:", ", ".join(f"{kind} {error:.1e}" for kind, error in found.items()))


if __name__ == "__main__":
    main()
