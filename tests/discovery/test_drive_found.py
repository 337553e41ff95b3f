"""What is hidden in the drive is named as the drive's: recordings of the three-phase model, found by discovery."""

from __future__ import annotations

import pytest
from support.hidden_effects import ACTUATOR, recorded
from support.representative import first_of

from ema_model.discovery import discover
from ema_model.effects import CATALOGUE

CHIRP = ("chirp", {}, 0.5)
STEPS = ("staircase", {"step_rad": 0.02, "dwell_s": 0.1}, 0.5)
# All of the drive's, and what they are mistaken for most.
AMONG = (
    *(name for name, effect in CATALOGUE.items() if effect.family == "drive"),
    *("current_sensor_gain", "hinge_moment", "inertia_error", "presliding_friction"),
)
# Values of the first parameter, what is recorded, and the current's noise, A.
CASES = {
    "dead_band": (2e-4, [CHIRP], 0.45),
    "acceleration_limit": (0.03, [STEPS], 0.45),
    "sampled_control": (3e-4, [CHIRP, STEPS], 0.1),
    "speed_filter": (2e-3, [CHIRP, STEPS], 0.45),
    "speed_loop_gain": (-0.6, [CHIRP, STEPS], 0.45),
    "speed_loop_integral": (200.0, [CHIRP, STEPS], 0.45),
    "velocity_feedforward": (0.7, [CHIRP], 0.45),
    "goal_rate_limit": (0.35, [STEPS], 0.45),
    "goal_gain": (0.03, [CHIRP, STEPS], 0.45),
    "goal_delay": (6e-3, [CHIRP, STEPS], 0.45),
}


@pytest.mark.parametrize("name", first_of(list(CASES)))
def test_what_is_hidden_in_the_drive_is_named(name):
    value, commands, noise = CASES[name]
    parameter = CATALOGUE[name].parameters[0].name
    recordings = recorded(71, commands=commands, effects={name: {parameter: value}}, load=10.0, noise_A=noise)
    found = discover(recordings, ACTUATOR, candidates=AMONG, most_effects=1)
    if CATALOGUE[name].duplicates:
        assert found.parameters_outside_tolerance == [CATALOGUE[name].duplicates] and not found.effects
        return
    [one] = found.effects
    assert one.name == name and found.to_dict()["effects"][0]["family"] == "drive"
    assert one.parameters[parameter].value == pytest.approx(value, rel=0.15)
