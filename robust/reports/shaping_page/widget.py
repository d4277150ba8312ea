"""The shaping page as the output of a notebook cell, from which the shaped controller can be
read.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

import control

from nlfrf._base.extras import import_extra
from robust._base.types import Controller, Weight
from robust.models.sets.model import UncertaintyModel
from robust.reports.shaping_page.elements import shaped_controller
from robust.reports.shaping_page.generated_text import PartSources
from robust.reports.shaping_page.page import page_content, read_script, read_style

if TYPE_CHECKING:
    import anywidget

_RENDER = """
export default { render({ model, el }) {
  const root = document.createElement("div");
  el.append(root);
  const begin = model.get("state");
  const tell = state => { model.set("state", state); model.save_changes(); };
  start(root, model.get("content"), tell, begin.elements ? begin : null);
} };
"""


def shape(
    model: UncertaintyModel | Sequence[UncertaintyModel],
    *,
    w_P: Weight | None = None,
    K: Controller | None = None,
    dt: float = 0.0,
    delay: float = 0.0,
) -> anywidget.AnyWidget:
    """Shape a loop by hand in a notebook: show the page of `write_shaping_page` in a cell.

    Drag gain, integrator, lead, notch and roll-off in the plot of |L|. The field `K` of the result
    is the present controller, which `check` can prove.

    Parameters
    ----------
    model : UncertaintyModel or list of them
        The uncertainty model, or one model for each level.
    w_P : control.StateSpace or TransferFunction, optional
        Performance weight.
    K : control.StateSpace, TransferFunction or float, optional
        Controller at the start, which is multiplied by the elements that you drag.
    dt : float
        Sampling time [s] of the controller. 0: sampling time of K or of a sampled model, otherwise
        a continuous controller.
    delay : float
        Computation delay [s], as in `check`.

    Returns
    -------
    anywidget.AnyWidget
        Widget with the fields `K`, the present controller of the page as control.StateSpace, and
        `state`, its gain and elements.

    Raises
    ------
    ValueError
        A model without a parametric nominal, a form that the page cannot compute, or sampling times
        that differ.
    ImportError
        The package anywidget is missing.

    References
    ----------
    SP 2.6 (loop shaping), 7.5 and 7.6 (rs and rp).

    Examples
    --------
    >>> shape([], dt=0.01)
    Traceback (most recent call last):
        ...
    ValueError: model must be an UncertaintyModel or a list of them, got []
    """
    content = page_content(model, w_P=w_P, K=K, dt=dt, delay=delay, sources=PartSources())
    return _widget_class()(content=content, state=content["begin"], begun=1.0 if K is None else K)


@cache
def _widget_class() -> type[anywidget.AnyWidget]:
    """Return the class of the widget; it is made at first use, because anywidget is an extra."""
    import_extra("anywidget", "notebook", "shape, unlike write_shaping_page,")
    import anywidget
    import traitlets

    class LoopShaper(anywidget.AnyWidget):
        """The page in a cell."""

        _esm = read_script() + _RENDER
        _css = read_style()
        content = traitlets.Dict().tag(sync=True)
        state = traitlets.Dict().tag(sync=True)

        def __init__(self, *, begun: Controller = 1.0, **traits: object) -> None:
            super().__init__(**traits)
            self.begun = begun

        @property
        def K(self) -> control.StateSpace:
            """Present controller of the page."""
            return shaped_controller(self.state, self.begun, self.content["dt"])

    return LoopShaper
