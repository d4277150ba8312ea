"""The page of the command `robust shape`, with the paths of its files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.files import page_path, write_text
from robust.models.fit.given_weights import performance_weight
from robust.models.sets.model import UncertaintyModel
from robust.reports.shaping_page.generated_text import PartSources
from robust.reports.shaping_page.page import page_content, page_text

if TYPE_CHECKING:
    import control


def write_from_files(
    out: Path,
    models: list[UncertaintyModel],
    K: control.StateSpace | None,
    paths: tuple[Sequence[Path], Path | None],
    demand: tuple[float | None, float, float],
    **loop: float,
) -> None:
    """Write the page for models and a controller with their paths; demand is (bandwidth [Hz], peak,
    error).
    """
    files, controller = paths
    out, (bandwidth, peak, error) = page_path(out), demand
    sources = PartSources(
        names=tuple(path.stem for path in files),
        files=tuple(map(str, files)),
        controller="" if controller is None else str(controller),
        demand=f"robust.performance_weight(2 * np.pi * {bandwidth!r}, M_S={peak!r}, A={error!r})",
        options=""
        if bandwidth is None
        else f"--bandwidth {bandwidth!r} --peak {peak!r} --error {error!r}",
        title="Shape a loop around " + ", ".join(path.stem for path in files),
    )
    if bandwidth is None:
        w_P = None
        omega_c = None
    else:
        w_P = performance_weight(2 * np.pi * bandwidth, M_S=peak, A=error)
        omega_c = 2 * np.pi * bandwidth
    write_text(
        out, page_text(page_content(models, w_P=w_P, K=K, sources=sources, omega_c=omega_c, **loop))
    )
