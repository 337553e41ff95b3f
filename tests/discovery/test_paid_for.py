"""What the data pay for, and what a parameter that is free to move says of an effect like it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from ema_model.actuator import Tolerance
from ema_model.discovery import objections, refit
from ema_model.estimation import Calibrated

ARM = "effects.pendulum_load.moment_Nm"


def fit_with(z: float, at_bound: bool = False, path: str = "sensors.current_bias_A"):
    """A fit in which a parameter stands so many σ from the file."""
    one = Calibrated(0.0, 0.0, (0.0, 0.0), "", z, at_bound)
    return SimpleNamespace(calibration=SimpleNamespace(parameters={path: one}))


@pytest.mark.parametrize(
    ("before", "path"),
    [
        (fit_with(0.3), ""),
        (fit_with(2.5), "sensors.current_bias_A"),
        (fit_with(3.0, at_bound=True), "sensors.current_bias_A"),
        (fit_with(0.0, path="motor.inertia_kgm2"), "sensors.current_bias_A"),
    ],
    ids=["free and unmoved", "moved", "at its bound", "not free"],
)
def test_a_parameter_that_is_free_and_stays_is_not_what_is_missing(before, path):
    assert refit.stands_for(before, "constant_load") == path


def test_an_effect_that_is_no_parameter_stands_for_none():
    assert refit.stands_for(fit_with(3.0), "cogging_torque") == ""


@pytest.mark.parametrize(
    ("before", "after", "fall", "holds"),
    [
        (2.0, 1.97, 0.02, True),
        (2.0, 1.99, 0.02, False),
        (0.97, 0.955, 0.03, True),
        (0.97, 0.968, 0.03, False),
        (0.97, 0.9715, 0.005, False),
    ],
)
def test_what_falls_where_it_was_fitted_must_fall_elsewhere(before, after, fall, holds):
    assert refit._holds(before, after, fall) is holds


def arm(moment_Nm: float, file: bool = True):
    """Fits before and after an arm's moment was freed: 0.50 ± 0.02 N·m in the file."""
    effects = {"pendulum_load": {"moment_Nm": 0.5, "angle_rad": 0.0}} if file else {}
    actuator = SimpleNamespace(effects=effects, tolerances={ARM: Tolerance(0.02, True)})
    found = SimpleNamespace(effects={"pendulum_load": {"moment_Nm": moment_Nm, "angle_rad": 0.4}})
    return SimpleNamespace(actuator=actuator), SimpleNamespace(calibration=SimpleNamespace(actuator=found))


def test_an_effect_of_the_file_is_claimed_beyond_its_tolerance_alone():
    assert "within the file's tolerances" in objections._within(*arm(0.55), "pendulum_load")
    assert not objections._within(*arm(0.57), "pendulum_load")
    assert not objections._within(*arm(0.55, file=False), "pendulum_load")


def bound(z: float, at_bound: bool):
    path = "sensors.current_gain"
    found = fit_with(z, at_bound, path)
    return SimpleNamespace(calibration=found.calibration, actuator=SimpleNamespace(axes=None))


def test_what_stands_a_hair_off_its_bound_without_an_effect_is_not_driven_there(monkeypatch):
    monkeypatch.setattr(objections, "_title", lambda found, path: "current gain")
    assert not objections._bent(bound(-2.96, False), bound(-2.99, True), "constant_load")
    assert "drives the current gain" in objections._bent(bound(-1.0, False), bound(-2.99, True), "constant_load")
    settled = bound(-2.99, True)
    assert "drives" in objections._bent(settled, settled, "constant_load"), "a settled model has no other before it"
