"""The picture of the README, from what the first example measured and found: `make picture`."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt

import nlfrf
import robust
from docs.gallery import outputs
from nlfrf.plot import plot_bla
from robust.plot import plot_nyquist

PICTURE = Path(__file__).resolve().parent / "_static" / "result.png"


def main() -> None:
    """One record, its BLA and bound; the loop designed on it, with every plant the record allows."""
    folder = outputs("01_identify_then_design")
    bla = nlfrf.load(folder / "bla.npz")
    report = robust.check(
        robust.load(folder / "model.json"),
        robust.load(folder / "controller.json"),
        certify=False,
    )
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(11, 4.9), layout="constrained", gridspec_kw={"width_ratios": [1.55, 1]}
    )
    plot_bla(bla, ax=left)
    left.set_title("One record of a machine with friction: the FRF, and how far it can be believed")
    plot_nyquist(report, ax=right)
    right.set_title("The loop, with every plant in the set")
    figure.savefig(PICTURE, dpi=80)
    print(f"wrote {PICTURE}: {PICTURE.stat().st_size / 1024:.0f} kB")


if __name__ == "__main__":
    main()
