"""The forms of uncertainty: what a perturbation of gain one makes of a plant and of its loop."""

from __future__ import annotations

import numpy as np

__all__ = [
    "FORMS",
    "PARTS",
    "PERTURBATIONS",
    "PORTS",
    "absolute_to_form",
    "loop_discs",
    "perturbed_response",
    "worst_terms",
]


def perturbed_response(form: str, G: np.ndarray, w: np.ndarray, Delta: np.ndarray) -> np.ndarray:
    """(W,) response of the perturbed plant from responses of nominal, weight and perturbation."""
    return {
        "multiplicative": lambda: G * (1 + w * Delta),
        "additive": lambda: G + w * Delta,
        "inverse-multiplicative": lambda: G / (1 + w * Delta),
        "inverse-additive": lambda: G / (1 + w * G * Delta),
    }[form]()


PARTS = ("noise", "odd", "even", "misfit", "level", "systematic")


def absolute_to_form(form: str, omega: np.ndarray, absolute: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Factor from an absolute radius to the radius of the form."""
    if form == "additive":
        return np.ones(omega.size)
    if np.any(center == 0):
        raise ValueError(f"nominal must not vanish on a line for the {form} form, got zero")
    if form == "multiplicative":
        return 1 / center
    if np.any(absolute >= center):
        k = int(np.argmax(absolute / center))
        raise ValueError(
            f"form must be multiplicative or additive where the radius reaches |G|, got {form} with a radius of "
            f"{absolute[k] / center[k]:.3g} |G| at {omega[k] / 2 / np.pi:.4g} Hz"
        )
    return 1 / (center - absolute) / (1.0 if form == "inverse-multiplicative" else center)


# form of the uncertainty: (where Delta reads, where it acts)
PORTS = {
    "multiplicative": ("u", "p_in"),
    "additive": ("u", "p_out"),
    "inverse-multiplicative": ("y", "p_out"),
    "inverse-additive": ("y", "p_in"),
}


def worst_terms(form: str, w: np.ndarray, G: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """S, a and b of the perturbed sensitivity S_p = S (1 + a Delta)/(1 + b Delta), from responses."""
    with np.errstate(all="ignore"):
        S = 1 / (1 + G * K)
        a = {
            "multiplicative": np.zeros_like(S),
            "additive": np.zeros_like(S),
            "inverse-multiplicative": w + 0 * S,
            "inverse-additive": w * G,
        }[form]
        b = {
            "multiplicative": w * G * K * S,
            "additive": w * K * S,
            "inverse-multiplicative": w * S,
            "inverse-additive": w * G * S,
        }[form]
    return S, a, b


def loop_discs(form: str, w: np.ndarray, G: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre and radius of the disc that L fills over the set; nan where it is the outside of a disc instead."""
    L = G * K
    if form == "multiplicative":
        return L, np.abs(w * L)
    if form == "additive":
        return L, np.abs(w * K)
    size = np.abs(w * G) if form == "inverse-additive" else np.abs(w)
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = size < 1
        centre, radius = L / (1 - size**2), np.abs(L) * size / (1 - size**2)
    return np.where(inside, centre, np.nan), np.where(inside, radius, np.nan)


FORMS = ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive")
PERTURBATIONS = ("LTI", "statistical", "operator")
