"""Estimated numbers of a machine: with their intervals, units and text."""

from __future__ import annotations

import numpy as np

import nlfrf
from robust.pages.section import Fact

#: Half-width of a 95 % interval in standard deviations.
HALF_WIDTH = 1.96
#: Units with a name of their own, for a quantity in terms of force F and length L.
_NAMED = {("F s^2/L", "N", "m"): "kg", ("F s^2/L", "Nm", "rad"): "kg m^2"}


def unit_of(quantity: str, units: tuple[str, str]) -> str:
    """Return the unit of a quantity in terms of force F and length L, for the units of both."""
    force, length = units
    made = quantity.replace("L", length).replace("F", force)
    return _NAMED.get((quantity, *units), made)


#: Numbers with an interval: label, unit in terms of force F and length L, and factor to this unit.
REPORTED = {
    "mass": ("mass m", "F s^2/L", 1.0),
    "damping": ("viscous friction c", "F s/L", 1.0),
    "stiffness": ("spring to ground k", "kF/L", 1e-3),
    "K0": ("presliding stiffness K0", "kF/L", 1e-3),
    "Fs": ("break-away force Fs", "F", 1.0),
    "coulomb": ("Coulomb friction", "F", 1.0),
    "offset": ("constant force offset", "F", 1.0),
    "stiction": ("stiction over Coulomb friction", "", 1.0),
    "delay": ("delay with lag", "ms", 1e3),
    "load_mass": ("mass of the load", "F s^2/L", 1.0),
    "coupling": ("spring between motor and load", "kF/L", 1e-3),
    "coupling_damping": ("damper between motor and load", "F s/L", 1.0),
    "load_K0": ("presliding stiffness at the load", "kF/L", 1e-3),
    "load_Fs": ("break-away force at the load", "F", 1.0),
    "load_coulomb": ("Coulomb friction at the load", "F", 1.0),
}


class NumbersRead:
    """Estimated numbers of a machine by name, each with its standard deviation and unit."""

    stds: dict[str, float]
    units: tuple[str, str]
    mass: float
    damping: float
    delay: float
    load_mass: float
    coupling: float
    coupling_damping: float

    def interval(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a number by its name."""
        half = HALF_WIDTH * self.stds[name]
        return getattr(self, name) - half, getattr(self, name) + half


def number_facts(fit: NumbersRead) -> list[Fact]:
    """Return each number of a fit that has a standard deviation: its 95 % interval, or "left
    open".
    """
    facts = []
    for name, (label, unit, factor) in REPORTED.items():
        std = fit.stds.get(name, 0.0)
        if not np.isfinite(std):
            facts.append(Fact(label, "left open"))
        elif std:
            half = factor * HALF_WIDTH * std
            number = format_rounded(factor * getattr(fit, name), half)
            facts.append(Fact(label, f"{number} +- {half:.1g}", unit_of(unit, fit.units)))
    return facts


def format_rounded(number: float, half: float) -> str:
    """Return a number with one digit more than its error, but at most six digits.

    >>> format_rounded(6.322, 1000.0), format_rounded(2.00123, 0.001), format_rounded(19.9526, 0.04)
    ('0', '2.0012', '19.953')
    """
    step = 10.0 ** (np.floor(np.log10(half)) - 1)
    return f"{float(np.round(number / step)) * step + 0.0:.6g}"


def units_of(record: nlfrf.Record) -> tuple[str, str]:
    """Return the units of force and position of a record; N and m if it has none."""
    return record.u_unit or "N", record.y_unit or "m"
