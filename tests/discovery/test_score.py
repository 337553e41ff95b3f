"""What is known of an effect beforehand, on a machine of another size too, and what amounts make of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.discovery import terms
from ema_model.discovery.fingerprints import Fingerprint
from ema_model.effects import find


@pytest.mark.parametrize(
    ("name", "current_A", "strong"),
    [
        ("torque_saturation", 22.5, 1.0 / 67.5),
        ("torque_saturation", 3.0, 1.0 / 9.0),
        ("torque_saturation", 300.0, 0.0125),
        ("torque_saturation", 0.0, 0.0125),
        ("mesh_friction", 3.0, 0.25),
    ],
    ids=["the library's motor", "a small one", "a large one", "no current known", "a ratio"],
)
def test_iron_saturates_by_what_its_machine_draws(name, current_A, strong):
    signals = {"current_A": np.array([0.5, -1.0]) * current_A}
    found = SimpleNamespace(calibration=SimpleNamespace(signals=[signals]))
    assert terms.strong_case(found, find(name)) == pytest.approx(strong)


@pytest.mark.parametrize("start", [0.15, 0.1, 0.07, 0.3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_rounding_takes_a_candidate_out_of_its_range(start, sign):
    """(0.95 / 0.15) 0.15 is more than 0.95: a discovery had ended in an error by that."""
    first = find("load_dependent_friction").parameters[0]
    end = first.high if sign > 0.0 else first.low
    found = SimpleNamespace(actuator=load_actuator())
    one = Fingerprint("load_dependent_friction", {"ratio": start}, np.zeros((1, 1)))
    settings = terms.settings_at(found, one, np.array([end / start]))
    assert first.low <= settings["ratio"] <= first.high and settings["ratio"] == pytest.approx(end)


@pytest.mark.parametrize(("torque_Nm", "times"), [(169.2, 100.0), (0.1, 1.0)])
def test_a_strong_case_is_as_strong_as_the_machine(torque_Nm, times):
    """Teeth of a motor of a hundred times the torque pull a hundred times as hard: they are not within its noise."""
    shown = [{"motor_torque_Nm": np.array([0.0, -torque_Nm])}]
    found = SimpleNamespace(calibration=SimpleNamespace(signals=shown, actuator=load_actuator()))
    cogging = find("cogging_torque")
    assert terms.strong_case(found, cogging) == pytest.approx(times * cogging.severities[2])
