"""The loop of a set and a controller with several channels, with the perturbations as external
blocks.
"""

from __future__ import annotations

from functools import cached_property

import control
import numpy as np

from nlfrf._base.values import value
from robust._base.types import Blocks, Controller, Weight
from robust.analysis.disk import LoopMargins, disk_margins
from robust.analysis.findings import Given
from robust.analysis.sampled_set import SampledSet, set_on_controller_time_base
from robust.lti.grids import Peak, peak_of, structure_grid
from robust.lti.lti import response_by_channel, timebase
from robust.models.sets.interconnection import UncertainSystem
from robust.models.sets.model import UncertaintyModel
from robust.mu.gain import gain_bound
from robust.mu.set_gain import bound_set_gain
from robust.proofs.search.stability import decide_stability


@value
class LoopOfChannels:
    """A set and a controller with several channels on one time base."""

    model: UncertaintyModel  # the set as given
    K: control.StateSpace
    w_P: Weight | None  # performance weight
    delay: float  # computation delay [s] in addition to that of the model

    @cached_property
    def forms(self) -> dict[str, tuple[UncertaintyModel, SampledSet | None]]:
        """Each form of the set on the time base of the controller, and the sampled set that
        contains its aliases.
        """
        forms = [one for one in (self.model, self.model.alternative_form) if one is not None]
        return {one.form: set_on_controller_time_base(one, self.K, self.delay) for one in forms}

    @property
    def given(self) -> Given:
        """Input of the check: class, demand, delay, band and unit."""
        band, perturbation = self.model.omega[[0, -1]], self.model.perturbation
        dt = timebase(self.K) or timebase(self.model.nominal)  # a gain has none of its own
        return Given(
            perturbation=perturbation, demand=self.w_P, delay=float(self.delay), dt=dt, band=band
        )

    @cached_property
    def systems(self) -> dict[str, UncertainSystem]:
        """The loop with its perturbations pulled out, for each form of the set."""
        return {form: model.loop(self.K, w_P=self.w_P) for form, (model, _) in self.forms.items()}

    @cached_property
    def channels(self) -> LoopMargins:
        """Disk margins of the nominal loop."""
        return disk_margins(next(iter(self.forms.values()))[0], self.K)

    def sensitivity(self, form: str) -> UncertainSystem:
        """Return the loop with S as its performance."""
        return performance_loop(self.forms[form][0], self.K, None)

    def folded(self, form: str) -> SampledSet | None:
        """Return the sampled set that contains the aliases; None without aliases."""
        return self.forms[form][1]


def performance_loop(model: UncertaintyModel, K: Controller, w_P: Weight | None) -> UncertainSystem:
    """Return the loop with several channels and performance S or w_P S; refuse one whose nominal is
    not stable.
    """
    one = control.StateSpace([], [], [], [[1.0]], model.nominal.dt)
    system = model.loop(K, w_P=one if w_P is None else w_P)
    nominal = decide_stability(system.N)
    if not nominal.stable:
        raise ValueError(
            "K must stabilise the nominal plant, because a worst case exists only then, got a"
            f" loop that is {nominal}"
        )
    return system


@value
class _SetGain:
    """Upper bounds (W,) of the largest gain from inputs to outputs over a set."""

    omega: np.ndarray  # frequencies [rad/s]
    gain: np.ndarray
    # 0 if the largest bound is proved at all frequencies, and attained within 0.1 % at its own;
    # else the number of frequencies checked
    n_lines: int = 0

    @property
    def peak(self) -> Peak:
        """Largest bound."""
        return peak_of(self.omega, self.gain)


def set_gain(
    N: control.StateSpace, blocks: Blocks, *, curve: bool = True, certify: bool = True
) -> _SetGain:
    """Bound the largest gain over a set.

    curve : compute the bound on a grid too, not only at the frequency of its largest value.
    certify : prove the largest bound at all frequencies; else the bound holds on the grid only.
    """
    if certify:
        found = bound_set_gain(N, blocks)
    else:
        found = None
    if found is None or not found.is_proved:
        omega = np.union1d(structure_grid(N)[1:], [] if found is None else [found.omega])
        return _SetGain(
            omega=omega, gain=gain_bound(response_by_channel(N, omega), blocks), n_lines=omega.size
        )
    omega = np.array([found.omega])
    if curve:
        omega = np.union1d(structure_grid(N)[1:], omega)
    gain = gain_bound(response_by_channel(N, omega), blocks)
    return _SetGain(
        omega=omega, gain=np.where(omega == found.omega, found.upper, np.minimum(gain, found.upper))
    )
