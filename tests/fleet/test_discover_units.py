"""The physics that units lack, from recordings of the three-phase model."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ema_model.actuator import load_actuator
from ema_model.fleet.discovery import discover_units, sentences
from ema_model.simulated_fleets import draw, recorded

ACTUATOR = load_actuator()
BACKLASH = "transmission.backlash_rad"
COGGING = {"amplitude_Nm": 0.012, "order": 12.0, "phase_rad": 0.3}


@pytest.mark.long
def test_all_units_lack_cogging_and_one_has_more_play():
    fleet = draw(ACTUATOR, 5, units=3, differing=0)
    x = fleet.x.copy()
    x[1, fleet.parameters.index(BACKLASH)] += 0.8
    fleet = replace(fleet, x=x)
    every = [recorded(replace(fleet.unit(i), effects={"cogging_torque": COGGING}), 5, i) for i in range(3)]
    fitted = {name: [one[run] for run in fleet.runs] for name, one in zip(fleet.names, every)}
    held = {name: [one["unseen"]] for name, one in zip(fleet.names, every)}
    found = discover_units(fitted, ACTUATOR, holdout=held)
    (lack,) = found.lacks
    assert lack.effect == "cogging_torque" and found.is_of_all(lack) and not found.unexplained
    for one in lack.by_unit.values():
        assert one.parameters["amplitude_Nm"].value == pytest.approx(COGGING["amplitude_Nm"], rel=0.15)
        assert one.holdout_before is not None and one.holdout_after < 0.8 * one.holdout_before
    assert [(one.unit, one.parameter) for one in found.compared.differences] == [("unit_02", BACKLASH)]
    told = sentences(found)
    assert told[0] == "all 3 units lack cogging torque" and told[1].startswith(
        "beside it, unit_02 differs from the rest"
    )
