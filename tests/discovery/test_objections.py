"""What speaks against an effect: parts that disagree, values that no part has, a signal that is not there."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.actuator import Tolerance
from ema_model.discovery.evidence import objections
from ema_model.discovery.objections import disagreement
from ema_model.effects import find
from ema_model.estimation import Calibrated
from ema_model.quantities.axes import ROTARY

RANDOM = np.random.default_rng(7)
N = 4000
KEY, PATH = "hinge_moment", "effects.hinge_moment.stiffness_Nm_rad"


def fitted(amplitudes, noise=1.0, settings=None, at_bound=False, path=PATH):
    """A fit of y = amplitude·shape over recordings, of which each has its own amplitude, of 1 altogether."""
    key = path.split(".")[1]
    count = len(amplitudes)
    shape = np.sin(np.arange(N) / 30.0)
    residual = np.concatenate([(1.0 - a) * shape + noise * RANDOM.standard_normal(N) for a in amplitudes])
    one = Calibrated(1000.0, 500.0, (900.0, 1100.0), "", 1.0, at_bound)
    windows = [
        SimpleNamespace(measured={"current_A": 0}, blocks=N, recording=i, time_s=np.arange(N) * 1e-3 + i)
        for i in range(count)
    ]

    class Fit(SimpleNamespace):
        __hash__ = object.__hash__

    calibration = SimpleNamespace(
        parameters={path: one},
        starts={},
        x=np.ones(1),
        residual=residual,
        weighted_jacobian=np.tile(0.5 * shape, count)[:, None],
        actuator=SimpleNamespace(effects={key: find(key).settings(settings or {})}, value=lambda path: 9.5e-6),
        converged=True,
        signals=[{"motor_position_rad": np.linspace(0.0, 3.0, N), "current_A": np.linspace(0.0, -15.0, N)}],
    )
    actuator = SimpleNamespace(tolerances={path: Tolerance(500.0, True)}, axes=ROTARY, effects={})
    return Fit(plant=SimpleNamespace(windows=windows), residual=residual, calibration=calibration, actuator=actuator)


DATA = SimpleNamespace(signals={"current_A": 1.0}, measurements=[{"current_A": 0}] * 2)


def test_recordings_that_agree_let_an_effect_be():
    assert disagreement(DATA, fitted([1.0, 1.0]), KEY) is None
    assert disagreement(DATA, fitted([1.05, 0.95], noise=0.2), KEY) is None, "no model is exact to the last digit"


def test_recordings_that_ask_for_other_values_are_told():
    apart = disagreement(DATA, fitted([1.8, 0.2]), KEY)
    assert apart is not None and apart.parameter == PATH
    assert apart.values == pytest.approx([1800.0, 200.0], abs=150.0)


def test_what_is_left_decides_how_sure_parts_are():
    """The same two values, in an error that is thirty times the noise and lasts: they may be chance."""
    lasting = fitted([1.8, 0.2])
    lasting.residual = lasting.residual + 60.0 * np.repeat(RANDOM.standard_normal(2 * N // 200), 200)
    lasting.calibration.residual = lasting.residual
    assert disagreement(DATA, lasting, KEY) is None


def test_a_single_recording_is_judged_by_its_halves():
    whole = fitted([1.8, 0.2])
    for window in whole.plant.windows:
        window.recording = 0
    whole.plant.windows[1].time_s = whole.plant.windows[1].time_s + 4.0
    assert disagreement(DATA, whole, KEY) is not None


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        ("hinge_moment", {"stiffness_Nm_rad": -110.0}, "not plausible"),
        ("current_sensor_gain", {"ratio": -0.51}, "not plausible"),
        ("screw_lead_error", {"amplitude_rad": 1e-3, "period_rad": 40.0}, "longer than the travel"),
        ("torque_saturation", {"saturation_1_A": 0.06}, "not plausible at 15.0 A"),
        ("torque_saturation", {"saturation_1_A": 0.02}, ""),
        (
            "asymmetric_friction",
            {"ratio": 0.1, "viscous_part_Nms_rad": 5.6e-4},
            "beside a motor viscous friction of 9.5",
        ),
        ("asymmetric_friction", {"ratio": 0.1, "viscous_part_Nms_rad": -5e-6}, ""),
        ("hinge_moment", {"stiffness_Nm_rad": 500.0}, ""),
        ("current_sensor_gain", {"ratio": -0.06}, ""),
    ],
)
def test_values_that_no_such_part_has_are_not_claimed(name, settings, said):
    found = fitted([1.0, 1.0], settings=settings, path=f"effects.{name}.{next(iter(settings))}")
    reason = objections.implausible(found, name)
    assert (said in reason) if said else not reason


def test_a_parameter_at_its_bound_is_no_claim():
    found = fitted([1.0, 1.0], at_bound=True)
    assert "at the bound" in objections._bent(found, found, KEY)
    assert not objections._bent(fitted([1.0, 1.0]), fitted([1.0, 1.0]), KEY)


def test_a_sensor_that_was_not_recorded_has_no_bias():
    blind = SimpleNamespace(measurements=[{"user_position_rad": 0}])
    assert "not recorded" in objections.unmeasured(blind, "current_sensor_bias")
    assert not objections.unmeasured(blind, "position_sensor_bias") and not objections.unmeasured(
        DATA, "current_sensor_bias"
    )
    assert not objections.unmeasured(blind, "cogging_torque_2")


def test_what_takes_nothing_away_within_the_tolerances_is_not_claimed(monkeypatch):
    monkeypatch.setattr(objections, "ratio", lambda _, found: found)
    monkeypatch.setattr(objections, "at_floor", lambda *_: False)
    assert "does not fall" in objections._idle(DATA, 4.07, 4.06)
    assert not objections._idle(DATA, 4.07, 3.90)


@pytest.mark.parametrize(
    ("bent", "calm", "said"),
    [((5.0, 4.0), (9.1, 8.8), "it explains"), ((5.0, 4.0), (9.1, 4.0), ""), ((1.8, 1.3), (2.8, 2.5), "")],
)
def test_the_share_that_counts_is_of_what_the_settled_models_leave(monkeypatch, bent, calm, said):
    """A model that is bent to an error of unknown cause tells more of it than it may; near the floor two share it."""
    monkeypatch.setattr(objections, "ratio", lambda _, found: float(np.sqrt(np.mean(found.residual**2))))
    monkeypatch.setattr(objections, "at_floor", lambda *_: False)
    monkeypatch.setattr(objections, "with_intervals", lambda data, found: found.calibration)
    before, after = (fitted([1.0, 1.0], noise=one) for one in bent)
    settled = {found: fitted([1.0, 1.0], noise=one) for found, one in zip((before, after), calm)}
    found = objections._against_settled(DATA, before, after, [KEY], settled.__getitem__)
    assert found.startswith(said) and bool(found) == bool(said)


@pytest.mark.parametrize(
    ("before", "after", "kept"),
    [
        (1.09, 1.07, True),
        (1.09, 1.03, False),
        (1.031, 1.022, True),
        (1.2, 1.06, False),
        (1.6, 1.5, False),
        (1.045, 1.036, True),
        (1.0, 0.99, False),
    ],
    ids=[
        "hardly less",
        "in the band",
        "hardly less in it",
        "most of it",
        "far from true",
        "hardly into it",
        "at the floor",
    ],
)
def test_of_a_model_that_may_be_true_an_effect_takes_most_or_is_not_claimed(monkeypatch, before, after, kept):
    """Nine of ten true models leave up to 1.04 floors here, and one of a hundred up to 1.25."""
    monkeypatch.setattr(objections, "floor_ratio", lambda data, plant, signals: plant)
    monkeypatch.setattr(objections, "may_be_true", lambda data, fit: fit.plant <= 1.25)
    fits = [SimpleNamespace(plant=error, calibration=SimpleNamespace(signals=[])) for error in (before, after)]
    said = objections._faint(SimpleNamespace(floor_band=(0.96, 1.04)), *fits)
    assert said == ("a true model may leave as much, and most of it stays" if kept else "")


@pytest.mark.parametrize(
    ("error", "key", "is_needless"),
    [(0.94, "mesh_friction", True), (1.05, "mesh_friction", False), (0.94, "viscous_friction", False)],
    ids=["at its floor", "above it", "a parameter's value"],
)
def test_nothing_is_added_to_a_model_at_its_floor(monkeypatch, error, key, is_needless):
    monkeypatch.setattr(objections, "floor_ratio", lambda data, plant, signals: plant)
    before = SimpleNamespace(plant=error, calibration=SimpleNamespace(signals=[]))
    said = objections._needless(DATA, before, [key])
    assert said == ("without it no more than the floor is left" if is_needless else "")


@pytest.mark.parametrize(
    ("path", "at_bound", "may_be_true", "is_new", "said"),
    [
        ("motor.viscous_friction_Nms_rad", True, True, False, "stands at its bound"),
        ("motor.viscous_friction_Nms_rad", True, False, False, ""),
        ("motor.viscous_friction_Nms_rad", False, True, False, ""),
        ("effects.pendulum_load.moment_Nm", True, True, False, "stands at its bound"),
        (PATH, True, True, True, ""),
        ("k2", True, True, False, ""),
    ],
    ids=["at its bound", "far from true before", "free", "of an effect of the file", "the effect's own", "a fault"],
)
def test_beside_a_model_that_may_be_true_no_effect_needs_a_parameter_at_its_bound(
    monkeypatch, path, at_bound, may_be_true, is_new, said
):
    monkeypatch.setattr(objections, "may_be_true", lambda data, fit: may_be_true)
    before, after = fitted([1.0, 1.0]), fitted([1.0, 1.0])
    after.calibration.parameters = {path: Calibrated(1.0, 0.5, (0.9, 1.1), "", 1.0, at_bound)}
    before.calibration.parameters = {} if is_new else after.calibration.parameters
    reason = objections._strained(DATA, before, after)
    assert (said in reason) if said else not reason


@pytest.mark.parametrize(
    ("key", "told", "of_file", "is_open"),
    [
        ("position_sensor_gain", {"ratio": (-0.051, 0.047)}, False, True),
        ("position_sensor_gain", {"ratio": (-0.051, 0.0321)}, False, False),
        ("hinge_moment", {"stiffness_Nm_rad": (0.3, 0.25)}, False, True),
        ("torsional_compliance", {"stiffness_Nm_rad": (4000.0, 5000.0)}, False, False),
        ("inertia_error", {"ratio": (0.134, 0.098)}, False, False),
        ("pendulum_load", {"moment_Nm": (0.3, 0.25)}, True, False),
        ("asymmetric_friction", {"ratio": (0.12, 0.11), "viscous_part_Nms_rad": (13.0, 0.9)}, False, False),
        ("asymmetric_friction", {"ratio": (0.12, 0.11), "viscous_part_Nms_rad": (0.9, 0.9)}, False, True),
    ],
    ids=[
        "nearly none",
        "apart from none",
        "a stiffness",
        "none is far",
        "open as its tolerance",
        "the file's own",
        "one part of two",
        "both parts",
    ],
)
def test_an_effect_whose_interval_nearly_reaches_none_of_it_is_not_claimed(monkeypatch, key, told, of_file, is_open):
    parameters = {
        f"effects.{key}.{name}": Calibrated(value, 1.0, (value - half, value + half), "", 1.0, False)
        for name, (value, half) in told.items()
    }
    monkeypatch.setattr(objections, "with_intervals", lambda data, found: SimpleNamespace(parameters=parameters))
    base = SimpleNamespace(actuator=SimpleNamespace(effects={key: {}} if of_file else {}))
    reason = objections._may_be_none(DATA, base, fitted([1.0, 1.0], path=next(iter(parameters))), key)
    assert ("may as well be none" in reason) if is_open else not reason
