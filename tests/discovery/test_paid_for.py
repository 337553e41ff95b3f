"""What the data pay for, and what a parameter that is free to move says of an effect like it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.actuator import Tolerance
from ema_model.discovery.candidates import paid_for, refit
from ema_model.discovery.evidence import objections
from ema_model.effects import find
from ema_model.estimation import Calibrated

ARM = "effects.pendulum_load.moment_Nm"


BIAS = "sensors.current_bias_A"
LOAD = [1.0, 1.0, 0.0]  # what a constant load moves
AS_LOAD, READING_ALONE = [2.0, 2.1, 0.0], [1.0, 1.0, 5.0]  # what a bias does


def fit_with(z: float, at_bound: bool = False, path: str = BIAS):
    """A fit in which a parameter stands so many σ from the file."""
    one = Calibrated(0.0, 0.0, (0.0, 0.0), "", z, at_bound)
    return SimpleNamespace(calibration=SimpleNamespace(parameters={path: one}))


def trial_of(name: str, path: str = BIAS, bias: list[float] = AS_LOAD):
    """An effect refitted beside a parameter: bias, LOAD are how they move the signals."""
    names = dict.fromkeys([path, f"effects.{name}.{find(name).parameters[0].name}"])
    columns = np.array([bias, LOAD]).T
    fit = SimpleNamespace(calibration=SimpleNamespace(parameters=names, weighted_jacobian=columns))
    return SimpleNamespace(candidate=SimpleNamespace(name=name), fit=fit)


@pytest.mark.parametrize(
    ("before", "bias", "path"),
    [
        (fit_with(0.3), AS_LOAD, ""),
        (fit_with(2.5), AS_LOAD, BIAS),
        (fit_with(2.5), READING_ALONE, ""),
        (fit_with(3.0, at_bound=True), AS_LOAD, BIAS),
        (fit_with(3.0, at_bound=True), READING_ALONE, ""),
    ],
    ids=["free and unmoved", "moved", "moves otherwise", "at its bound", "at its bound, moves otherwise"],
)
def test_a_parameter_that_stays_or_moves_otherwise_is_not_what_is_missing(before, bias, path):
    assert refit.stands_for(before, trial_of("constant_load", bias=bias)) == path


def test_a_parameter_that_is_not_free_may_be_what_is_missing():
    other = "motor.inertia_kgm2"
    assert refit.stands_for(fit_with(0.0, path=other), trial_of("constant_load", other, READING_ALONE)) == BIAS


def test_an_effect_that_is_no_parameter_stands_for_none():
    assert refit.stands_for(fit_with(3.0), trial_of("cogging_torque")) == ""


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
    assert paid_for._holds(before, after, fall) is holds


@pytest.mark.parametrize(
    ("change", "after", "worth", "silent"),
    [
        (0.10, 0.9005, 480.0, True),
        (0.30, 0.9005, 480.0, False),  # it would have fallen by 6 % if all were true
        (0.10, 0.9200, 480.0, False),  # it rises by more than it was asked to fall
        (0.10, 0.9005, 60.0, False),  # and what was fitted might be chance
    ],
)
def test_what_could_not_show_an_effect_says_nothing_against_it(monkeypatch, change, after, worth, silent):
    current, fitted = (SimpleNamespace(error=lambda error=error: error) for error in (1.0, 0.88))
    held = SimpleNamespace()
    monkeypatch.setattr(paid_for, "holdout_error", lambda data, found: 0.9 if found is current else after)
    monkeypatch.setattr(paid_for, "holdout_change", lambda data, one, other: change)
    monkeypatch.setattr(paid_for, "worth", lambda data, before, trial: worth)
    assert paid_for._holds_its_peace(None, held, current, SimpleNamespace(fit=fitted)) is silent


def arm(moment_Nm: float, file: bool = True):
    """Fits before and after an arm's moment was freed: 0.50 ± 0.02 N·m in the file."""
    effects = {"pendulum_load": {"moment_Nm": 0.5, "angle_rad": 0.0}} if file else {}
    actuator = SimpleNamespace(effects=effects, tolerances={ARM: Tolerance(0.02, True)})
    found = SimpleNamespace(effects={"pendulum_load": {"moment_Nm": moment_Nm, "angle_rad": 0.4}})
    return SimpleNamespace(actuator=actuator), SimpleNamespace(calibration=SimpleNamespace(actuator=found))


def test_an_effect_of_the_file_is_claimed_beyond_its_tolerance_alone():
    assert "within the file's tolerances" in objections.within(*arm(0.55), "pendulum_load")
    assert not objections.within(*arm(0.57), "pendulum_load")
    assert not objections.within(*arm(0.55, file=False), "pendulum_load")


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
