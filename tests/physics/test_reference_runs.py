"""Several runs of the Reference Model at once are those of one after the other, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import Recorded
from ema_model.simulation.plant import SHOWN, simulate_references
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()
SAMPLES, RATE_HZ = 400, 10_000.0
TIME = np.arange(SAMPLES * 10) * 1e-5
COMMAND = Recorded(TIME, 0.01 * np.sin(2.0 * np.pi * 40.0 * TIME))
STILL = dict.fromkeys(("load_Nm", "start_rad", "start_speed_rad_s", "start_play_rad", "start_integral_Nm"), 0.0)


@pytest.mark.parametrize("integral", [0.0, 2.0], ids=["plain", "with an integral action"])
def test_each_lane_is_a_run_of_its_own(integral):
    actuator = ACTUATOR.varied({"controller.integral_gain_Nm_rad": integral})
    k = 0.5 * np.random.default_rng(3).random((3, 8))
    friction, load, turned = (np.array(one) for one in ([0.004, 0.006, 0.008], [0.0, 5.0, -5.0], [0.0, 1e-4, 2e-4]))
    start = {"start_speed_rad_s": 2.0, "start_play_rad": 1e-3, "start_integral_Nm": 0.0}
    varied = actuator.varied({"motor.dynamic_friction_Nm": friction})
    together = simulate_references(COMMAND, SAMPLES, RATE_HZ, varied, k, {}, load_Nm=load, start_rad=turned, **start)
    for i in range(len(k)):
        one = simulate_reference(
            Run(COMMAND, SAMPLES / RATE_HZ, RATE_HZ, load_torque_Nm=load[i]),
            actuator.varied({"motor.dynamic_friction_Nm": friction[i]}),
            k[i],
            start_rad=turned[i],
            **start,
        )
        for name in SHOWN:
            assert np.array_equal(together[name][i], one[name][1:]), name
            assert np.ptp(one[name]) > 0.0


def test_too_many_are_refused():
    with pytest.raises(ValueError, match="33 runs at once; 16 are the most"):
        simulate_references(COMMAND, SAMPLES, RATE_HZ, ACTUATOR, np.zeros((33, 8)), {}, **STILL)


def test_one_that_diverges_is_told():
    with pytest.raises(FloatingPointError, match="diverged"):
        actuator = ACTUATOR.varied({"motor.inductance_H": np.array([1e-9, 1e-9])})
        simulate_references(COMMAND, SAMPLES, RATE_HZ, actuator, np.zeros((2, 8)), {}, **STILL)
