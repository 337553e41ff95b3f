"""What a score makes of an effect: a strong case on a machine of another size, settings within their range."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.discovery.candidates import score
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
    assert score.strong_case(found, find(name)) == pytest.approx(strong)


@pytest.mark.parametrize("start", [0.15, 0.1, 0.07, 0.3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_rounding_takes_a_candidate_out_of_its_range(start, sign):
    """(0.95 / 0.15) 0.15 is more than 0.95: a discovery had ended in an error by that."""
    random = np.random.default_rng(3)
    columns, own = random.normal(size=(400, 1)), random.normal(size=(400, 1))
    found = SimpleNamespace(
        residual=-sign * 100.0 * columns[:, 0],
        actuator=load_actuator(),
        calibration=SimpleNamespace(
            room=np.array([[-9.0], [9.0]]), parameters=["p"], starts=[], weighted_jacobian=own, signals=[]
        ),
    )
    prints = [Fingerprint("load_dependent_friction", {"ratio": start}, columns)]
    [candidate] = score.scored_all(found, prints)
    first = find("load_dependent_friction").parameters[0]
    assert first.low <= candidate.settings["ratio"] <= first.high
    assert candidate.settings["ratio"] == pytest.approx(first.high if sign > 0.0 else first.low)


@pytest.mark.parametrize(("torque_Nm", "times"), [(169.2, 100.0), (0.1, 1.0)])
def test_a_strong_case_is_as_strong_as_the_machine(torque_Nm, times):
    """Teeth of a motor of a hundred times the torque pull a hundred times as hard: they are not within its noise."""
    shown = [{"motor_torque_Nm": np.array([0.0, -torque_Nm])}]
    found = SimpleNamespace(calibration=SimpleNamespace(signals=shown, actuator=load_actuator()))
    cogging = find("cogging_torque")
    assert score.strong_case(found, cogging) == pytest.approx(times * cogging.severities[2])
