"""A fault and missing physics that look like other physics: told once both are in the model."""

from __future__ import annotations

import pytest
from support.hidden_effects import ACTUATOR, recorded

from ema_model.comparison.thresholds import BAND
from ema_model.discovery import discover

COMMANDS = [
    ("chirp", {}, 0.5),
    ("step", {"final_rad": 0.005}, 0.5),
    ("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}, 1.0),
]
SPRINGS = ("hinge_moment", "cubic_spring", "pendulum_load", "one_sided_spring", "constant_load")
UNSEEN = [("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5.0}, 0.5)]


def found_in(seed, faults, effects, candidates=None):
    fitted, held = (recorded(seed, commands=its, faults=faults, effects=effects) for its in (COMMANDS, UNSEEN))
    return discover(fitted, ACTUATOR, holdout=held, candidates=candidates)


def check(found, faults, effect):
    assert found.verdict == "effects_found" and [one.name for one in found.effects] == [effect]
    assert set(found.faults) == set(faults) and not found.parameters_outside_tolerance
    for name, value in faults.items():
        assert found.faults[name].value == pytest.approx(value, abs=0.05)
    assert found.ladder[-1].rmse < BAND and found.ladder[-1].holdout_rmse < BAND


@pytest.mark.long
@pytest.mark.parametrize("candidates", [SPRINGS, None], ids=["springs", "all"])
def test_an_effect_that_stands_only_beside_a_fault_is_claimed_with_it(candidates):
    """Beside the shorted phase alone each recording asks for another spring, and a cubic one would take its place."""
    faults = {"k3": 0.26}
    found = found_in(1, faults, {"hinge_moment": {"stiffness_Nm_rad": 1000.0}}, candidates)
    check(found, faults, "hinge_moment")
    assert found.effects[0].parameters["stiffness_Nm_rad"].value == pytest.approx(1000.0, rel=0.1)
    assert "hinge_moment" not in found.not_claimed


@pytest.mark.long
def test_a_fault_takes_the_place_of_the_effect_that_looked_like_it():
    """Friction in a zone as wide as the travel is friction, once the bias beside it is known."""
    faults = {"k1": 0.46}
    found = found_in(1, faults, {"asymmetric_friction": {"ratio": 0.12}})
    check(found, faults, "constant_load")
    assert "asymmetric_friction" in found.effects[0].same_as
    assert [rung.change.kind for rung in found.ladder] == ["calibrated", "fault", "effect"]
