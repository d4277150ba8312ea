"""Bla values with a known truth behind them, for the tests of `robust`."""

from __future__ import annotations

import numpy as np

from nlfrf.bla.bla import Bla, Covariances, DistortionLevels, Experiment
from nlfrf.signals.lines import LineGrid


def make_bla(
    G,
    f,
    *,
    sigma_noise=0.0,
    sigma_distortion=0.0,
    sigma_even=0.0,
    dof=6.0,
    f0=None,
    fs=None,
    rng=None,
    n_realizations=1,
    hold="unknown",
):
    """A Bla scattered about G(j omega) (callable, or an array at f) with known standard deviations.

    The sigmas are absolute, scalars or one per line. The stated variances are drawn too: chi-square
    over its `dof` complex degrees of freedom, as an estimate would be. rng=None: no scatter, the
    true variances.
    """
    f = np.asarray(f, dtype=float)
    f0 = f0 if f0 is not None else float(f[0])
    excited = np.unique(np.maximum(1, np.round(f / f0)).astype(int))
    if excited.size != f.size:
        f0 = float(np.diff(f).min())
        excited = np.unique(np.maximum(1, np.round(f / f0)).astype(int))
    fs = fs if fs is not None else 4 * float(f[-1])
    true = np.asarray(G(2j * np.pi * f) if callable(G) else G, dtype=complex)
    ones = np.ones(f.size)
    var_noise, var_odd = ones * sigma_noise**2, ones * sigma_distortion**2
    var_total = var_noise + var_odd / n_realizations
    measured, estimated = true, var_total
    if rng is not None:
        rng = np.random.default_rng(rng)
        scatter = (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)) / np.sqrt(2)
        measured = true + scatter * np.sqrt(var_total)
        estimated = var_total * rng.gamma(dof, 1 / dof, size=f.size)
    ratio = np.divide(estimated, var_total, out=np.ones(f.size), where=var_total > 0)
    none = np.zeros((n_realizations, 0), dtype=complex)
    return Bla(
        f=f,
        G=measured,
        lines=LineGrid(excited=excited),
        experiment=Experiment(
            grid="special-odd",
            n_samples=max(4, round(fs / f0)),
            n_realizations=n_realizations,
            n_periods=2,
        ),
        hold=hold,
        fs=fs,
        cov=Covariances(
            gamma=np.ones((1, 1, f.size)),
            noise=var_noise[None, None],
            total=estimated[None, None],
            distortion=(var_odd * ratio / n_realizations)[None, None],
            even=(ones * sigma_even**2 / n_realizations)[None, None],
            bound=estimated[None, None],
        ),
        level_source="detection",
        dof=ones * dof,
        grid_factor=ones,
        levels=DistortionLevels(
            f_excited=f,
            f_odd=np.zeros(0),
            f_even=np.zeros(0),
            excited=np.tile(measured, (n_realizations, 1)),
            odd=none,
            even=none,
            noise_excited=np.sqrt(var_noise),
            noise_odd=np.zeros(0),
            noise_even=np.zeros(0),
        ),
    )
