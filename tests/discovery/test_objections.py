"""What speaks against an effect: parts that disagree, values that no part has, a signal that is not there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.actuator import Tolerance
from ema_model.discovery import objections
from ema_model.discovery.objections import disagreement
from ema_model.effects import find
from ema_model.estimation import Calibrated
from ema_model.estimation.model_fit import Data
from ema_model.quantities import ROTARY

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


DATA = Data([{"current_A": 0}] * 2, None, (), {"current_A": 1.0})


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
        ("torque_saturation", {"saturation_1_A": 0.0225}, ""),  # a third is 0.0222, within its interval
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
    first, value = next(iter(settings.items()))
    path = f"effects.{name}.{first}"
    found = fitted([1.0, 1.0], settings=settings, path=path)
    known = (value - 0.05 * abs(value), value + 0.05 * abs(value))
    found.calibration.parameters[path] = replace(found.calibration.parameters[path], value=value, interval90=known)
    reason = objections.implausible(found, name)
    assert (said in reason) if said else not reason


def test_a_sensor_that_was_not_recorded_has_no_bias():
    blind = SimpleNamespace(measurements=[{"user_position_rad": 0}])
    assert "not recorded" in objections.unmeasured(blind, "current_sensor_bias")
    assert not objections.unmeasured(blind, "position_sensor_bias") and not objections.unmeasured(
        DATA, "current_sensor_bias"
    )
    assert not objections.unmeasured(blind, "cogging_torque_2")
