"""A loop that follows its command another way than the file's: its controller is to blame, and no plant is."""

from __future__ import annotations

import pytest
from support.hidden_effects import ACTUATOR, recorded

from ema_model.comparison import compare
from ema_model.comparison.loop_lag import loop_lag
from ema_model.models import model_for

CHIRP, STEPS = ("chirp", {}, 0.5), ("staircase", {"step_rad": 0.02, "dwell_s": 0.1}, 0.5)
FED_FORWARD = {"velocity_feedforward": {"ratio": 1.0}}
OF_POSITION_GAIN_S = 1.0 / (ACTUATOR.controller.position_gain_1_s * ACTUATOR.transmission.gear_ratio)
BLAMED = "The controller is not what the file says. The position follows its command after"


def lag_of(effects, command=CHIRP):
    model = model_for(recorded(11, commands=[command], noise_A=0.2, effects=effects), ACTUATOR)
    before = [{name: one[0] for name, one in model.signals(i).items()} for i in range(len(model.windows))]
    return loop_lag(model, before)


def test_a_loop_trails_by_what_its_position_gain_is_whatever_it_drives():
    for effects in ({}, {"inertia_error": {"ratio": 0.4}}, {"viscous_friction": {"coefficient_Nms_rad": 2e-4}}):
        lag = lag_of(effects)
        assert lag is not None and not lag.differs
        assert lag.measured_s == pytest.approx(OF_POSITION_GAIN_S, rel=0.06), effects


@pytest.mark.parametrize(
    ("effects", "measured_s"),
    [
        (FED_FORWARD, 0.0),
        ({"velocity_feedforward": {"ratio": 0.5}}, 0.5 * OF_POSITION_GAIN_S),
        ({"goal_delay": {"delay_s": 8e-3}}, 8e-3 + OF_POSITION_GAIN_S),
    ],
    ids=lambda one: str(one)[:30],
)
def test_what_is_fed_forward_or_comes_late_shows_in_it(effects, measured_s):
    lag = lag_of(effects)
    assert lag is not None and lag.differs
    assert lag.measured_s == pytest.approx(measured_s, abs=3e-4)
    assert lag.of_file_s == pytest.approx(OF_POSITION_GAIN_S, rel=0.06)


def test_jumps_alone_tell_no_delay():
    assert lag_of({}, STEPS) is None


def test_a_comparison_says_so_where_its_parameters_end_at_their_bounds():
    found = compare(recorded(11, commands=[CHIRP], noise_A=0.2, effects=FED_FORWARD), ACTUATOR)
    assert found.over_floor > 100.0 and found.sentences[0].startswith(BLAMED)
    assert "with the file's controller would after 4." in found.sentences[0]


def test_a_plant_that_is_wrong_is_not_blamed_on_the_controller():
    """Its parameters end at their bounds as well, but it follows as the file's loop does."""
    plant = {"motor.inertia_kgm2": 4.0 * ACTUATOR.motor.inertia_kgm2, "motor.viscous_friction_Nms_rad": 3e-4}
    plant |= {"motor.dynamic_friction_Nm": 0.15, "motor.static_friction_Nm": 0.2}
    found = compare(recorded(11, commands=[CHIRP], noise_A=0.2, extra=plant), ACTUATOR)
    assert found.calibration is not None and not found.adequate
    assert sum(one.at_bound for one in found.calibration.parameters.values()) >= 3 and found.over_floor > 10.0
    assert not any(BLAMED in one for one in found.sentences)
