"""Systems in files of MATLAB, as matrices or as the fields of `get`: ss, tf and zpk."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import control
import numpy as np

from nlfrf.io import read_mat
from robust.lti.realisation import from_polynomials, from_roots, multivariable, order_roots

#: Fields of a system, by their letters in any case; the first complete set is used.
_STATE_SPACE, _POLYNOMIALS, _ROOTS = ("a", "b", "c", "d"), ("num", "den"), ("z", "p", "k")
_LONG_NAMES = {"numerator": "num", "denominator": "den"}
_INVERSE_VARIABLES = ("z^-1", "q^-1")
_DELAYS = ("inputdelay", "outputdelay", "iodelay", "internaldelay")
_CURE = (
    "in MATLAB: [A, B, C, D, Ts] = ssdata(ss(K)); save('K.mat', 'A', 'B', 'C', 'D', 'Ts', '-v7')"
)


def load_matlab_system(path: Path) -> control.StateSpace:
    """Read the system in a MATLAB file.

    The file may have matrices A, B, C, D; coefficients num, den in falling powers; or zeros z,
    poles p and gain k, with Ts [s] beside them. They may be fields of a struct, as from ``S =
    get(K)``. Among several structs that named K is read.

    Raises
    ------
    ValueError
        A file without a system or with several, a system without Ts, with a delay, in a unit of
        time other than seconds, or in descriptor form.
    FileNotFoundError
        No such file.
    """
    return _system_from_fields(_fields_of_controller(path), path.name)


def is_state_space(path: Path) -> bool:
    """Return whether the system in a MATLAB file has matrices, and so states of its own; a gain
    has.
    """
    fields = _fields_of_controller(path)
    return (
        all(_is_numeric(fields.get(key)) for key in _STATE_SPACE)
        or not load_matlab_system(path).nstates
    )


def _fields_of_controller(path: Path) -> dict[str, np.ndarray]:
    """Return the fields of the only controller in a MATLAB file."""
    homes: dict[str, dict[str, np.ndarray]] = {}
    for name, array in read_mat(path).items():
        home, _, key = name.rpartition(".")
        homes.setdefault(home, {})[_LONG_NAMES.get(key.lower(), key.lower())] = array
    found = {
        home: fields
        for home, fields in homes.items()
        if any(
            all(_is_numeric(fields.get(key)) for key in kind)
            for kind in (_STATE_SPACE, _POLYNOMIALS, _ROOTS)
        )
    }
    named = [home for home in found if home.rpartition(".")[2] == "K"] or list(found)
    if len(named) != 1:
        if named:
            what = f"{len(named)}, called {', '.join(home or 'nothing' for home in named)}"
        else:
            what = "none"
        raise ValueError(
            f"path must hold one controller as matrices or a struct, got {what} in {path.name!r};"
            f" {_CURE}"
        )
    fields = found[named[0]]
    return {**fields, "ts": fields.get("ts", homes.get("", {}).get("ts", np.empty(0)))}


def _is_numeric(array: np.ndarray | None) -> bool:
    return array is not None and array.dtype.kind in "fiubc"


def _sampling_time_of_fields(fields: Mapping[str, np.ndarray], name: str) -> float:
    """Return the sampling time [s]; raise without one, with a delay, or in other units."""
    if fields["ts"].size == 1 and _is_numeric(fields["ts"]):
        dt = float(fields["ts"].real.item())
    else:
        dt = -1.0
    if not dt >= 0:
        raise ValueError(
            f"Ts must be the sampling time [s] of the controller in {name!r}, 0 for continuous, got"
            " none"
        )
    if delayed := [key for key in _DELAYS if _is_numeric(fields.get(key)) and np.any(fields[key])]:
        raise ValueError(
            f"{delayed[0]} must be zero in {name!r}: remove it, and give the computation delay"
            " as --delay"
        )
    unit = str(fields.get("timeunit", np.array("seconds")))
    if unit != "seconds":
        raise ValueError(
            f"TimeUnit must be seconds in {name!r}, got {unit}; in MATLAB: K = chgTimeUnit(K,"
            " 'seconds')"
        )
    return dt


def _system_from_fields(fields: Mapping[str, np.ndarray], name: str) -> control.StateSpace:
    """Return the system of the fields of a file; refuse one that is not rational in seconds."""
    dt = _sampling_time_of_fields(fields, name)
    if all(_is_numeric(fields.get(key)) for key in _STATE_SPACE):
        E = np.atleast_2d(fields.get("e", np.empty(0)))
        if E.size and not np.array_equal(E, np.eye(len(E))):
            raise ValueError(f"E must be the identity in {name!r}, got a descriptor form; {_CURE}")
        return multivariable(
            "K",
            control.StateSpace(*_with_all_axes([fields[key] for key in _STATE_SPACE], name), dt),
        )
    if all(_is_numeric(fields.get(key)) for key in _POLYNOMIALS):
        num, den = (np.atleast_1d(fields[key]).astype(float) for key in _POLYNOMIALS)
        if (
            fields.get("variable", np.empty(0)).tolist() in _INVERSE_VARIABLES
        ):  # powers of 1/z, from the constant up
            n = max(num.size, den.size)
            num, den = (np.append(one, np.zeros(n - one.size)) for one in (num, den))
        return from_polynomials("K", num, den=den, dt=dt)
    zeros, poles, gain = (np.atleast_1d(fields[key]).astype(complex) for key in _ROOTS)
    for key, roots in (("z", zeros), ("p", poles)):
        if not np.allclose(np.sort_complex(roots), np.sort_complex(roots.conj())):
            raise ValueError(f"{key} must be real or conjugate in {name!r}, got {roots}")
    if gain.size != 1 or zeros.size > poles.size:
        raise ValueError(
            f"K must be proper with one input and one output in {name!r}, got {zeros.size} zeros,"
            f" {poles.size} poles and {gain.size} gains; {_CURE}"
        )
    return from_roots(order_roots(zeros), order_roots(poles), float(gain[0].real), dt)


def _with_all_axes(matrices: list[np.ndarray], name: str) -> list[np.ndarray]:
    """Return A, B, C and D with the axes of length one that reading has removed."""
    A, B, C, D = matrices
    if not A.size:
        n = 0
    elif A.ndim == 2:
        n = A.shape[0]
    else:
        n = 1
    if n:
        n_u = B.size // n
        n_y = C.size // n
    else:
        n_u = np.atleast_2d(D).shape[1]
        n_y = np.atleast_2d(D).shape[0]
    shapes = ((n, n), (n, n_u), (n_y, n), (n_y, n_u))
    for letter, matrix, shape in zip("ABCD", matrices, shapes, strict=True):
        if matrix.size != np.prod(shape) or (matrix.ndim == 2 and matrix.shape != shape):
            raise ValueError(
                f"{letter} must have the shape {shape} in {name!r}, got {matrix.shape}"
            )
    return [
        matrix.reshape(shape).astype(float) for matrix, shape in zip(matrices, shapes, strict=True)
    ]
