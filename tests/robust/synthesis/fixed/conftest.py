"""Shared by the tests of fixed structures: a light mode with a small set, and commands on its
file.
"""

import sys
from dataclasses import replace

import control
import numpy as np
import pytest

import robust
from robust import cli


@pytest.fixture
def command_on_light_mode(monkeypatch, capsys, tmp_path):
    """Run a line in a folder with the model of a light mode, m.json: exit code, standard output,
    standard error.
    """
    monkeypatch.chdir(tmp_path)
    omega, plant = np.geomspace(1, 600, 20), control.tf([60.0**2], [1, 36.0, 60.0**2])
    weight = control.tf([0.01], [1])
    robust.save(
        robust.UncertaintyModel(plant, weight, "multiplicative", omega, np.full(20, 0.01)), "m.json"
    )

    def run(line):
        monkeypatch.setattr(sys, "argv", line.split())
        with pytest.raises(SystemExit) as stop:
            cli.main()
        printed = capsys.readouterr()
        return stop.value.code or 0, printed.out, printed.err

    return run


@pytest.fixture
def said_of(command_on_light_mode, monkeypatch):
    """What `robust design --method pid` prints of a controller, whatever the design was."""
    design = robust.design_frf(control.tf([1], [1, 1]), "I", M_S=2.0, n_iterations=1)

    def say(K):
        made = replace(design, K=control.ss(K), K_free=None)
        with monkeypatch.context() as patch:
            patch.setattr(robust, "design_frf", lambda *_, **__: made)
            _, out, err = command_on_light_mode("robust design m.json --method pid -o K.json")
        return out, err

    return say
