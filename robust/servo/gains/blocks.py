"""Exact conversion between the gains of a drive and blocks of `robust.tune`.

The integral of the velocity loop adds the previous error, while a block is discretised by the
Tustin method. Both give the same controller if the gains are converted: kp (1 + Ts/tn z^-1/(1 -
z^-1)) = kp_b + ki Ts/2 (z + 1)/(z - 1) with ki = kp/tn and kp_b = kp - ki Ts/2. A filter is a block
without conversion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import require_kind
from nlfrf.rig import Drive
from robust.lti.lti import with_names
from robust.servo.gains.p_pi import (
    hold_mean,
    realise_fir,
    realise_section,
    times,
    velocity_section,
    warn_of_slow_position_loop,
)
from robust.synthesis.blocks import TunableBlock
from robust.synthesis.filters import Filter, Notch
from robust.synthesis.pid import Pid

_LEAST_DEPTH = 1e-3  # of a notch as a block, because `tune` searches for its logarithm


def to_blocks(
    settings: Drive, *, output_unit: str = ""
) -> tuple[list[control.StateSpace], dict[str, TunableBlock]]:
    """Return a drive as fixed systems and tunable blocks for `robust.tune`.

    Use this to tune the gains of a drive, starting at its present gains; `with_blocks` converts the
    tuned blocks back to gains.

    Parameters
    ----------
    settings : Drive
        Gains, filters, sampling and units.
    output_unit : str
        Unit of the plant input, as for `cascade`.

    Returns
    -------
    system : list of control.StateSpace
        Fixed systems, connected by the names of their signals. Their inputs are the set point "r",
        the disturbance "d" at the plant input, and the plant output "position" (with two encoders
        "motor" and "load"). Their output is the plant input "force" or "current". Internal signals,
        in the units of the velocity loop, are "position error", "velocity set point", "velocity
        error" and "set point".
    blocks : dict of str to block
        The position controller "K_x" and the velocity controller "K_v", a `Pid` each, and "filter
        1", "filter 2", ... for the filters. The start value of the depth of a notch is at least
        0.001.

    Raises
    ------
    ValueError
        Settings that are not a Drive, a position loop without gain, a reset time below half a
        period, or a unit of the plant input that needs a torque constant when none is given.

    Warns
    -----
    DesignWarning
        If the position loop runs slower than the velocity loop, as for `cascade`.

    Notes
    -----
    Pass `dt=settings.dt` to `tune`. Delay and lag of the current loop belong to the plant. A delay
    without lag can also be passed as `delay=settings.delay`.

    References
    ----------
    H. Gross, J. Hamann, G. Wiegärtner, *Electrical Feed Drives in Automation*, Publicis MCD, 2001:
    the cascade.

    Examples
    --------
    >>> settings = Drive(fs=1000, kv=31, kp=126, kp_unit="N/(m/s)", tn=0.04)
    >>> system, blocks = to_blocks(settings)
    >>> blocks["K_x"].kp, round(blocks["K_v"].ki, 6)
    (31.0, 3150.0)
    >>> again = with_blocks(settings, blocks)
    >>> round(again.kv, 9), round(again.kp, 9), round(again.tn, 9)
    (31.0, 126.0, 0.04)
    """
    require_kind("settings", settings, Drive)
    warn_of_slow_position_loop(settings)
    return _parts_and_blocks(settings, output_unit)


def _parts_and_blocks(
    settings: Drive, output_unit: str
) -> tuple[list[control.StateSpace], dict[str, TunableBlock]]:
    """Return the result of `to_blocks` without its warning."""
    unit = output_unit or settings.output_unit
    kp = settings.gain * settings.output_factor(unit)
    ki = kp / settings.tn
    if not settings.kv > 0:
        raise ValueError(
            f"settings must have a position loop with a gain, got kv = {settings.kv:g} 1/s"
        )
    if not kp > ki * settings.dt / 2:
        raise ValueError(
            f"settings must have a reset time above half a period, {settings.dt / 2:g} s, got tn ="
            f" {settings.tn:g} s"
        )
    slots = len(settings.filters)
    signals = [f"behind filter {k}" if k else "behind K_v" for k in range(slots)] + ["set point"]
    blocks: dict[str, TunableBlock] = {
        "K_x": Pid(kp=settings.kv, reads="held error", drives="velocity set point"),
        "K_v": Pid(kp=kp - ki * settings.dt / 2, ki=ki, reads="velocity error", drives=signals[0]),
    }
    system = _fixed_parts(settings, "current" if unit == "A" else "force")
    for k, slot in enumerate(settings.filters):
        require_kind("filters", slot, Filter)
        if isinstance(slot, Notch):
            slot = replace(slot, depth=max(slot.depth, _LEAST_DEPTH))
        blocks[f"filter {k + 1}"] = replace(slot, reads=signals[k], drives=signals[k + 1])
    return system, blocks


def _fixed_parts(settings: Drive, plant_input: str) -> list[control.StateSpace]:
    """Return the parts of a drive without gains: differences, hold, feedforward of the velocity,
    and the sums.
    """
    dt, n = settings.dt, settings.position_every
    both = settings.encoder == "both"
    if both:
        motor, load = "motor", "load"
    else:
        motor, load = "position", "position"
    factor = settings.load_scale.factor if both else settings.position_scale.factor
    velocity = times(
        settings.position_scale.factor, realise_section(velocity_section(settings), dt)
    )

    def gain(D: list[list[float]], reads: tuple[str, ...], drives: str) -> control.StateSpace:
        return with_names(control.StateSpace([], [], [], D, dt), reads, (drives,))

    parts = [
        gain([[factor, -factor]], ("r", load), "position error"),
        with_names(hold_mean(settings), ("position error",), ("held error",)),
        with_names(velocity, (motor,), ("velocity",)),
        gain([[1.0, -1.0]], ("velocity set point", "velocity"), "velocity error"),
        gain([[1.0, 1.0]], ("set point", "d"), plant_input),
    ]
    if settings.velocity_feedforward:
        ahead = settings.velocity_feedforward * settings.fs / n * factor
        difference = realise_fir(np.concatenate([[ahead], np.zeros(n - 1), [-ahead]]), dt)
        parts.append(with_names(difference, ("r",), ("difference",)))
        parts.append(with_names(hold_mean(settings), ("difference",), ("velocity set point",)))
    return parts


def with_blocks(
    settings: Drive, blocks: Mapping[str, TunableBlock], *, output_unit: str = ""
) -> Drive:
    """Return a drive with the gains and filters of tuned blocks.

    Use this after `tune`, to get the values of `kv`, `kp`, `tn` and of the filters to enter in the
    drive.

    Parameters
    ----------
    settings : Drive
        The drive that was given to `to_blocks`.
    blocks : dict of str to block
        Blocks of the tuned design (`design.blocks`), with the names from `to_blocks`.
    output_unit : str
        Unit of the plant input, as given to `to_blocks`.

    Returns
    -------
    Drive

    Raises
    ------
    ValueError
        Blocks with other names or of other kinds.

    References
    ----------
    Åström & Hägglund, *Advanced PID Control* (2006), 3.2: series and parallel form.

    Examples
    --------
    >>> from dataclasses import replace
    >>> settings = Drive(fs=1000, kv=31, kp=126, kp_unit="N/(m/s)", tn=0.04)
    >>> _, blocks = to_blocks(settings)
    >>> with_blocks(settings, blocks | {"K_x": replace(blocks["K_x"], kp=40.0)}).kv
    40.0
    """
    require_kind("settings", settings, Drive)
    _, own = _parts_and_blocks(settings, output_unit)
    for name, block in own.items():
        if type(blocks.get(name)) is not type(block) or blocks[name].present() != block.present():
            raise ValueError(
                f"blocks must hold {name!r} as to_blocks made it, a {type(block).__name__} with "
                f"{', '.join(block.present())}, got {blocks.get(name)}"
            )
    if set(blocks) - set(own):
        raise ValueError(
            f"blocks must be those of the drive, {', '.join(own)}, got"
            f" {', '.join(sorted(set(blocks) - set(own)))} too"
        )
    K_x, K_v = blocks["K_x"], blocks["K_v"]
    assert isinstance(K_x, Pid)
    assert isinstance(K_v, Pid)
    kp = K_v.kp + K_v.ki * settings.dt / 2
    scale = (
        settings.gain / settings.kp * settings.output_factor(output_unit or settings.output_unit)
    )
    filters = [
        replace(block, reads="", drives="")
        for name in own
        if isinstance(block := blocks[name], Filter)
    ]
    if K_v.ki:
        tn = kp / K_v.ki
    else:
        tn = np.inf
    return replace(settings, kv=K_x.kp, kp=kp / scale, tn=tn, filters=tuple(filters))
