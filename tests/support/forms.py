"""The sets of one channel by their formulas (SP 7.4, 7.5, 8.2.3), and their worst case by brute
force: what robust is held against.
"""

import numpy as np


def chord(G, H):
    """Chordal distance of two responses (Vinnicombe)."""
    return np.abs(G - H) / np.sqrt((1 + np.abs(G) ** 2) * (1 + np.abs(H) ** 2))


def _within_a_chord(G, w, Delta):
    t = w / np.sqrt(1 - np.abs(w) ** 2)
    return (G + t * Delta) / (1 - np.conj(G) * t * Delta)


#: Name of a form -> the plant at a perturbation |Delta| <= 1, from responses.
PERTURBED = {
    "multiplicative": lambda G, w, Delta: G * (1 + w * Delta),
    "additive": lambda G, w, Delta: G + w * Delta,
    "inverse-multiplicative": lambda G, w, Delta: G / (1 + w * Delta),
    "inverse-additive": lambda G, w, Delta: G / (1 + w * G * Delta),
    "coprime": _within_a_chord,
}
#: Name of a form -> size of the perturbation that turns G into H.
DEVIATION = {
    "multiplicative": lambda H, G: np.abs(H / G - 1),
    "additive": lambda H, G: np.abs(H - G),
    "inverse-multiplicative": lambda H, G: np.abs(G / H - 1),
    "inverse-additive": lambda H, G: np.abs(1 / H - 1 / G),
    "coprime": chord,
}
FORMS = tuple(PERTURBED)
#: Those that do not depend on the unit of the plant.
UNSCALED = FORMS[:4]


def worst_sensitivity(form, w, *, G, K, n=4000):
    """(W,) largest |1/(1 + K G_p)| over n perturbations of the rim; inf where the plant -1/K is in
    the set.
    """
    rim = np.exp(2j * np.pi * np.arange(n) / n)[:, None]
    worst = np.max(np.abs(1 / (1 + K * PERTURBED[form](G, w, rim))), axis=0)
    return np.where(DEVIATION[form](-1 / K, G) > np.abs(w), worst, np.inf)
