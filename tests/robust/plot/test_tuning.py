"""The picture of a tuned design shows its limits where they are."""

import control
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

import robust
from robust import tuning

ERROR = control.summing_junction(["r", "-y"], "e")
FORCE = control.summing_junction(["u", "d"], "f")


def designed(K, **options):
    plant = tuning.Plants([control.tf([k], [1, 1, 0]) for k in (1.0, 2.0)], inputs="f", outputs="y")
    hard, soft = [tuning.Limit("d", "f", 1.5)], [tuning.Limit("d", "y", 1.0, band=(0.0, 0.1))]
    block = {"K": tuning.Gain(K=K, reads="e", drives="u")}
    return robust.tune(
        [ERROR, FORCE], plant, block, hard=hard, soft=soft, rng=0, n_starts=1, **options
    )


def test_curves_before_and_after_and_a_dot_where_each_is_largest(ax):
    design = designed(0.2)
    assert robust.plot.plot_limits(design, ax=ax) is ax
    drawn = [line.get_xydata() for line in ax.get_lines()]
    for one in design.limits:
        dot = next(xy for xy in drawn if xy.shape == (1, 2) and xy[0, 1] == one.ratio)
        assert dot[0, 0] <= one.omegas[-1] / 2 / np.pi * (1 + 1e-9)
        s = 1j * one.omegas
        G = (one.plant + 1) / (s * (s + 1))
        before = (1 if one.limit.outputs == ("f",) else G) / (1 + 0.2 * G) / one.limit.bound
        assert one.before == pytest.approx(np.abs(before), rel=1e-9)
        assert max(one.curve) <= one.ratio * (1 + 1e-9)
    assert ax.get_legend() is not None or any(
        line.get_label().startswith("hard") for line in ax.get_lines()
    )
    assert "met" in ax.get_title()


def test_an_unstable_start_has_no_curve_before(ax):
    design = designed(-0.2)
    assert all(np.isnan(one.before).all() for one in design.limits)
    robust.plot.plot_limits(design, ax=ax)
