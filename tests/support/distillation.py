"""The distillation column of SP 8.11.3, its weights and its inverse-based controller."""

import control
import numpy as np

GAIN = np.array([[87.8, -86.4], [108.2, -109.6]])
BLOCKS = [(1, 1), (1, 1)]
WITH_PERFORMANCE = [*BLOCKS, (2, 2)]


def plant():
    """P from (u_Delta, w, u) to (y_Delta, z, e): w_I on the input, w_P on the output, e = -(G u +
    w).
    """
    w_I = control.ss([[-2.0]], [[1.0]], [[-3.6]], [[2.0]])  # (s + 0.2)/(0.5 s + 1)
    w_P = control.ss([[-1e-6]], [[1.0]], [[0.05]], [[0.5]])  # (s/2 + 0.05)/s with a slow pole
    lag = control.ss([[-1 / 75]], [[1.0]], [[1 / 75]], [[0.0]])
    I, O = np.eye(2), np.zeros((2, 2))
    # (u_D, w, u) -> (u, u + u_D, w)
    first = control.ss([], [], [], np.block([[O, O, I], [GAIN, O, GAIN], [O, I, O]]))
    middle = control.append(w_I, w_I, lag, lag, 1, 1)
    # (w_I u, y, w) -> (y_D, y + w, -(y + w))
    last = control.ss([], [], [], np.block([[I, O, O], [O, I, I], [O, -I, -I]]))
    return control.append(control.ss([], [], [], I), w_P, w_P, 1, 1) * (last * (middle * first))


def controller():
    """0.7/s G^-1 (the pole at zero as it is: the loop moves it)."""
    lead = control.ss([[0.0]], [[1.0]], [[0.7]], [[0.7 * 75.0]])  # 0.7 (75 s + 1)/s
    return control.ss([], [], [], np.linalg.inv(GAIN)) * control.append(lead, lead)
