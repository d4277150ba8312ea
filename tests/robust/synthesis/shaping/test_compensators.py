"""Compensators: what they do at the frequencies they name."""

import numpy as np
import pytest

import robust
from tests.support.responses import response


def test_elements_do_what_they_say():
    w = 20.0
    for dt in (0.0, 0.01):
        at = np.array([w])
        for phase in np.radians([20, 60, 80]):
            k = response(robust.shaping.lead(w, phase, dt=dt), at)[0]
            assert (abs(k), np.angle(k)) == pytest.approx((1.0, phase))
        assert abs(response(robust.shaping.notch(w, depth=0.02, dt=dt), at)[0]) == pytest.approx(
            0.02
        )
        assert abs(response(robust.shaping.low_pass(w, zeta=0.5, dt=dt), at)[0]) == pytest.approx(
            1.0
        )
        assert abs(response(robust.shaping.low_pass(w, order=1, dt=dt), at)[0]) == pytest.approx(
            np.sqrt(0.5)
        )
        assert np.degrees(
            np.angle(response(robust.shaping.lag(w, np.inf, dt=dt), at)[0])
        ) == pytest.approx(-45)
        K = robust.shaping.pid(2.0, 3.0, 0.4, filter_time=0.05, dt=dt)
        s = 2 / dt * np.tan(0.5 * w * dt) * 1j if dt else 1j * w
        assert response(K, at)[0] == pytest.approx(2 + 3 / s + 0.4 * s / (0.05 * s + 1))
        # they multiply to a controller on one time base
        assert (K * robust.shaping.lead(w, 0.5, dt=dt) * robust.shaping.notch(w, dt=dt)).dt == dt


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: robust.shaping.lead(1.0, 2.0), "phase must be below pi/2"),
        (lambda: robust.shaping.lag(1.0, 0.5), "gain must be above 1"),
        (lambda: robust.shaping.low_pass(1.0, order=3), "order must be 1 or 2"),
        (lambda: robust.shaping.notch(-1.0), "omega must be positive"),
        (lambda: robust.shaping.pid(1.0, 0.0, 1.0), "filter_time must be positive"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
