"""A model settled to what it leaves: what is missing drives no parameter of the actuator to its bound."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.discovery import uncertainty
from ema_model.estimation.model_fit import Data

DRIVEN = ("motor.a", "motor.b", "motor.c", "motor.d")  # one after another, as the one before is held


@pytest.fixture
def held(monkeypatch):
    """What is held in each fit; a fit drives the first of DRIVEN that is not."""
    asked = []

    def fit(data, actuator, starts, tell, faults, held):
        asked.append(held)
        left = [path for path in DRIVEN if path not in held]
        parameters = {path: SimpleNamespace(at_bound=path == left[0]) for path in left}
        return stand_in(parameters | {"effects.x.y": SimpleNamespace(at_bound=True)})

    monkeypatch.setattr(uncertainty, "fit", fit)
    monkeypatch.setattr(uncertainty, "signals_of", lambda data, plant: [("current_A", slice(0, 8))])
    monkeypatch.setattr(uncertainty, "colour_of", lambda data, found: np.ones(8))
    monkeypatch.setattr(uncertainty, "replace", lambda one, **given: one)
    return asked


def stand_in(parameters):
    calibration = SimpleNamespace(parameters=parameters, residual=np.zeros(8), weighted_sensitivities=[])
    return SimpleNamespace(calibration=calibration, plant=None, actuator=None, starts={}, faults=())


def test_parameters_are_held_until_none_is_driven(held):
    found = uncertainty.settled(Data([], None, [], {}), stand_in({}), lambda told: None)
    assert held == [DRIVEN[:count] for count in range(len(DRIVEN) + 1)]
    assert [path for path, one in found.calibration.parameters.items() if one.at_bound] == ["effects.x.y"]
