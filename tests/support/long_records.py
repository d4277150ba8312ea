"""A long record of a cubic on disk, in every way that one gets there."""

import numpy as np

import nlfrf


def written(path, n_samples, n_periods, noise=0.003, kept=False):
    """A record on disk: as an instrument writes it, or as this package does."""
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(
        fs=1000, n_samples=n_samples, f_min=1000 / n_samples, f_max=2.5e5 / n_samples, rng=rng
    )
    u = np.tile(ms.u[:, None], (1, n_periods, 1))
    y = u + 0.1 * u**3 + 0.01 * rng.standard_normal(u.shape)
    u += noise * rng.standard_normal(u.shape)
    record = nlfrf.Record(u=u, y=y, fs=1000, lines=ms.lines)
    if kept:
        nlfrf.save(record, path)
    elif path.suffix == ".csv":  # with no more digits than a converter has
        table = np.column_stack([np.arange(u.size) / 1000, u.ravel(), y.ravel()])
        np.savetxt(path, table, delimiter=",", header="t [s],u,y", comments="", fmt="%.7g")
    elif path.suffix == ".npz":
        np.savez(path, u=u.ravel(), y=y.ravel(), fs=1000.0)
    else:
        import h5py

        with h5py.File(path, "w") as file:
            file["u"], file["y"], file.attrs["fs"] = u.ravel(), y.ravel(), 1000.0
    return record
