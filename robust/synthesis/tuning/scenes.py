"""The loop around every plant, from the fixed parts, the blocks and the limits."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import short_form
from robust.lti.lti import require_sampling_time, with_names
from robust.lti.realisation import multivariable
from robust.lti.wiring import Port, join_by_name
from robust.synthesis.tuning.closing import state_plant
from robust.synthesis.tuning.friction import FrictionChannel, FrictionLimit
from robust.synthesis.tuning.limits import Channel, Limit
from robust.synthesis.tuning.loops import ModelledLoop
from robust.synthesis.tuning.measured_loop import MeasuredLoop
from robust.synthesis.tuning.parameters import Controller
from robust.synthesis.tuning.plants import (
    MeasuredPlant,
    ModelledPlant,
    Plants,
    see_machine,
    see_plants,
)

#: Limits with True for hard ones, hard ones first.
Limits = list[tuple[Limit | FrictionLimit, bool]]


def fixed_parts(system: object, dt: float) -> list[control.StateSpace]:
    """Return all fixed parts on the time base of the design; refuse others."""
    if isinstance(system, control.StateSpace | control.TransferFunction):
        system = [system]
    if not isinstance(system, list | tuple):
        raise ValueError(f"system must hold control systems, as a list, got {short_form(system)}")
    parts = []
    for k, part in enumerate(system):
        part = multivariable(f"system[{k}]", part)
        require_sampling_time(f"system[{k}]", part, reference="the design", wanted=dt)
        on_clock = control.StateSpace(
            part.A, part.B, part.C, part.D, dt, remove_useless_states=False
        )
        parts.append(with_names(on_clock, part.input_labels, part.output_labels))
    return parts


def make_loops(
    parts: list[control.StateSpace],
    plants: Plants,
    *,
    controller: Controller,
    limits: Limits,
    dt: float,
    delay: float,
) -> list[ModelledLoop | MeasuredLoop]:
    """Return the loop around each plant with its limits."""
    gains = [limit for limit, _ in limits if isinstance(limit, Limit)]
    worst = any(limit.worst for limit in gains)
    external = list(dict.fromkeys(label for limit in gains for label in limit.inputs))
    looked_at = list(dict.fromkeys(label for limit in gains for label in limit.outputs))
    ports = [
        Port(reads=tuple(block.reads), drives=tuple(block.drives))
        for block in controller.blocks.values()
    ]
    sizes = (controller.n_states, controller.n_in, controller.n_out)
    n_u, n_y = len(plants.inputs), len(plants.outputs)
    scenes: list[ModelledLoop | MeasuredLoop] = []
    for k, seen in enumerate(see_plants(plants, dt, delay=delay, worst=worst)):
        if isinstance(seen, ModelledPlant):
            G = _with_perturbation(seen.system, plants, dt)
            if worst:
                into, out = _perturbation_names(n_u, n_y)
            else:
                into, out = [], []
            joined = join_by_name(
                [*parts, G], ports, external=external + into, looked_at=looked_at + out
            )
            fixed = state_plant(joined, *sizes, dt)
            channels = _channels_of(
                limits, external, looked_at=looked_at, plant=seen, sizes=(n_u, n_y)
            )
            scenes.append(ModelledLoop(k, fixed, seen, channels, dt))
        else:
            port = Port(reads=tuple(plants.inputs), drives=tuple(plants.outputs))
            joined = join_by_name(parts, [port, *ports], external=external, looked_at=looked_at)
            channels = _channels_of(
                limits, external, looked_at=looked_at, plant=seen, sizes=(n_u, n_y)
            )
            scenes.append(
                MeasuredLoop(
                    k,
                    joined,
                    seen,
                    channels,
                    dt=dt,
                    n_external=len(external),
                    n_looked_at=len(looked_at),
                    sizes=sizes,
                )
            )
    for index, (limit, _) in enumerate(limits):
        if not isinstance(limit, FrictionLimit):
            continue
        for machine in limit.machines:
            seen = see_machine(machine, plants, index=len(scenes), dt=dt, delay=delay)
            G = _with_perturbation(seen.system, plants, dt)
            into, _ = _perturbation_names(1, 1)
            joined = join_by_name(
                [*parts, G],
                ports,
                external=external + into,
                looked_at=looked_at + list(plants.outputs),
            )
            channel = FrictionChannel(
                limit=limit,
                index=index,
                machine=machine,
                place=(len(looked_at), len(external) + 1),
                dt=dt,
                delay=delay + machine.delay,
                plant=seen.system,
            )
            fixed = state_plant(joined, *sizes, dt)
            scenes.append(ModelledLoop(len(scenes), fixed, seen, [channel], dt))
    return scenes


def _perturbation_names(n_u: int, n_y: int) -> tuple[list[str], list[str]]:
    """Return the signals that a perturbation drives, and those that it reads."""
    into = [f"{_AT_INPUT}{i}" for i in range(n_u)] + [f"{_AT_OUTPUT}{j}" for j in range(n_y)]
    return into, [f"{_PLANT_INPUT}{i}" for i in range(n_u)]


def _with_perturbation(G: control.StateSpace, plants: Plants, dt: float) -> control.StateSpace:
    """Return the plant with disturbances at inputs and outputs, and its input as an output, for a
    perturbation.
    """
    n_u, n_y = G.ninputs, G.noutputs
    into, out = _perturbation_names(n_u, n_y)
    one, zero = np.eye(n_u), np.zeros((n_u, n_y))
    return control.StateSpace(
        G.A,
        np.hstack([G.B, G.B, np.zeros((G.nstates, n_y))]),
        np.vstack([G.C, np.zeros((n_u, G.nstates))]),
        np.block([[G.D, G.D, np.eye(n_y)], [one, one, zero]]),
        dt,
        inputs=[*plants.inputs, *into],
        outputs=[*plants.outputs, *out],
        remove_useless_states=False,
    )


def _channels_of(
    limits: Limits,
    external: list[str],
    *,
    looked_at: list[str],
    plant: ModelledPlant | MeasuredPlant,
    sizes: tuple[int, int],
) -> list[Channel]:
    """Return the rows and columns of the loop for each limit, for a plant with n_u inputs and n_y
    outputs.
    """
    perturbation = len(looked_at) + np.arange(sizes[0]), len(external) + np.arange(sum(sizes))
    return [
        Channel(
            limit=limit,
            index=k,
            hard=is_hard,
            rows=np.array([looked_at.index(label) for label in limit.outputs]),
            columns=np.array([external.index(label) for label in limit.inputs]),
            perturbation=perturbation if limit.worst else None,
            blocks=plant.blocks,
        )
        for k, (limit, is_hard) in enumerate(limits)
        if isinstance(limit, Limit)
    ]


def limit_name(k: int, limits: Limits) -> str:
    n_hard = sum(is_hard for _, is_hard in limits)
    if k < n_hard:
        return f"hard[{k}]"
    return f"soft[{k - n_hard}]"


#: Signals of the perturbation, with names that no user takes.
_AT_INPUT = "perturbation at plant input "
_AT_OUTPUT = "perturbation at plant output "
_PLANT_INPUT = "plant input "
