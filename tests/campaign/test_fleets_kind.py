"""How a comparison of a made fleet's units is scored beside its truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.campaign.kinds import FLEETS, FleetSettings, scored
from ema_model.errors import InputError
from ema_model.fleet.result import Difference, OfType, Transfer, UnitsCompared
from ema_model.simulated_fleets import Difference as True_
from ema_model.simulated_fleets import draw

ACTUATOR = load_actuator()
GAIN, CONSTANT, PLAY = "controller.speed_gain_Nms_rad", "motor.torque_constant_Nm_A", "transmission.backlash_rad"


def fleet(units: int, *differences: True_):
    return replace(draw(ACTUATOR, 0, units=units, differing=0), differences=differences)


def found(units: int, *differences: Difference) -> UnitsCompared:
    names = tuple(f"unit_{number:02d}" for number in range(1, units + 1))
    square, nothing = np.ones((units, units)), ((),) * units
    of_type = {PLAY: OfType(1e-5, (0.9e-5, 1.1e-5), 0.0, 1e-6, "rad", True)}
    transfer = Transfer("current_A", square, square[0], square)
    return UnitsCompared(
        ACTUATOR, names, nothing, nothing, differences, (), (), of_type, {}, transfer, (), square[0], ACTUATOR, ()
    )


def difference(unit: int, parameter: str, tolerances: float, half: float = 0.2, alike=()) -> Difference:
    sigma = ACTUATOR.tolerances[parameter].sigma
    low, high = sigma * (tolerances - half), sigma * (tolerances + half)
    return Difference(f"unit_{unit + 1:02d}", parameter, alike, sigma * tolerances, (low, high), None, None, 30.0, None)


def test_all_found_and_nothing_else():
    truth = fleet(6, True_((1, 4), PLAY, (PLAY,), 0.8), True_((0,), GAIN, (GAIN, CONSTANT), -1.0))
    answers = [difference(1, PLAY, 0.7), difference(4, PLAY, 0.3), difference(0, GAIN, -1.1)]
    row = scored(truth, found(6, *answers))
    assert row["exact"] and row["found"] == row["true"] == 3.0
    assert (row["covered"], row["counted"], row["right_sign"]) == (2.0, 3.0, 3.0)


def test_what_is_only_known_together_counts_as_one():
    truth = fleet(6, True_((0,), GAIN, (GAIN, CONSTANT), -1.0))
    assert scored(truth, found(6, difference(0, CONSTANT, -2.0, alike=(GAIN,))))["exact"]
    assert not scored(truth, found(6, difference(0, GAIN, -1.0, alike=(PLAY,))))["exact"]


def test_a_wrong_unit_is_missed_and_false_but_of_two_units_either_differs():
    for units, right in ((3, False), (2, True)):
        row = scored(fleet(units, True_((0,), PLAY, (PLAY,), 0.8)), found(units, difference(1, PLAY, -0.8)))
        assert row["exact"] == right and bool(row["false"]) != right
        assert row["right_sign"] == float(right)


def test_a_claim_about_equal_units_is_false():
    row = scored(fleet(4), found(4, difference(2, PLAY, 0.4)))
    assert row["claimed"] and not row["exact"] and row["false"] == [f"unit_03 {PLAY}"]
    told = FLEETS.told([row, scored(fleet(4), found(4))])
    assert told["exact set"] == "1 of 2" and told["fleets with a false claim"] == 1


@pytest.mark.parametrize("asked", [{"units": 1}, {"units": 30}, {"differing": 5}])
def test_no_such_settings(asked):
    with pytest.raises(InputError, match="units are from 2"):
        FleetSettings(**asked)
