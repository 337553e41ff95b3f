"""A drive whose controller nobody knows: a true model of it leaves what the floor says, whatever its log lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.unknown_drive import drive_of, logged

from ema_model.actuator import Actuator, Tolerance
from ema_model.comparison import compare
from ema_model.comparison.thresholds import SLOW
from ema_model.comparison.verdict import slow_ratio

SEEDS = range(12)


@pytest.fixture(params=["whole", "steady parts"])
def actuator(request, tmp_path) -> Actuator:
    return drive_of(tmp_path, leaves_out_reversals=request.param == "steady parts")


# By rate, Hz, noise, A, and the encoder's counts.
LOGGED = {"noise": (500.0, 0.2, None), "noise, logged fast": (2000.0, 0.2, None), "coarse": (1000.0, 0.05, 652.0)}


@pytest.mark.parametrize(
    ("steady", "log"),
    [
        (False, "coarse"),
        (True, "noise"),
        *(
            pytest.param(*one, marks=pytest.mark.long)
            for one in ((False, "noise"), (False, "noise, logged fast"), (True, "noise, logged fast"), (True, "coarse"))
        ),
    ],
)
def test_a_true_model_is_adequate_and_at_its_floor(tmp_path, steady, log):
    """A filter leaves noise alike for a while, which is no lasting error; what it cannot know at the ends, is none."""
    actuator = drive_of(tmp_path, leaves_out_reversals=steady)
    found = [compare([logged(seed, *LOGGED[log])], actuator) for seed in SEEDS]
    error = np.array([one.over_floor for one in found])
    print(np.round(error, 3), np.round(np.mean([one.floor_band for one in found], axis=0), 3))
    assert 0.9 <= np.median(error) <= 1.03
    assert max(slow_ratio(one.residuals, "current_A") for one in found) < 0.75 * SLOW
    assert sum(one.adequate for one in found) >= len(SEEDS) - 1
    assert sum(low <= one <= high for one, (low, high) in zip(error, (each.floor_band for each in found))) >= 9


def test_an_interval_ends_where_the_parameter_s_physics_does(tmp_path):
    """Of a static friction sliding tells nothing: its tolerance stays, but for what would be below zero."""
    actuator = drive_of(tmp_path, leaves_out_reversals=False)
    loose = {**actuator.tolerances, "motor.static_friction_Nm": Tolerance(0.01, True)}
    result = compare([logged(1)], replace(actuator, tolerances=loose))
    assert result.calibration is not None
    one = result.calibration.parameters["motor.static_friction_Nm"]
    print(one)
    assert one.interval90[0] == 0.0 and one.cut and one.interval90[1] > one.value
    assert one.sigma == pytest.approx(0.01, rel=0.05)  # of which the cut takes nothing
    assert one.from_file and "the file's" in str(result)
    sure = result.calibration.parameters["motor.inertia_kgm2"]
    assert not sure.cut and sure.value == pytest.approx(0.5 * sum(sure.interval90))


def test_a_share_of_the_residual_is_of_the_residual_as_it_is(actuator):
    """A hidden torque beside noise of its size explains a part of what is left, not all that stands above the noise."""
    recording = logged(3, 500.0, 0.2, None, hidden=lambda angle, speed: 0.011 * np.sin(angle))
    noisy = compare([recording], actuator)
    residual, best = noisy.residuals.values["current_A"], noisy.explained_by[0]
    size = float(np.std(0.011 / 0.05 * np.sin(noisy.residuals.variables["motor_angle"])))
    print(best.variable, best.r2, best.beyond_noise, size**2 / np.mean(residual**2))
    assert best.variable == "motor_angle" and best.significant
    assert best.r2 < best.beyond_noise <= 1.0 and best.r2 < 0.97
    assert best.r2 <= size**2 / np.mean(residual**2) + 0.1
    assert f"{100.0 * best.r2:.0f} % of the residual" in best.sentence
