"""No key of an actuator file is silently ignored: it changes what the fitted model says, or the file is refused.

The walk takes every kind of controller and drive, every key that its file may have, and the model that a recording of
it is held against; `test_reaches.py` does the same in the thesis's two models.
"""

from __future__ import annotations

import ast
import inspect
from itertools import product
from typing import Any

import numpy as np
import pytest

from ema_model.actuator import load_actuator, save_actuator
from ema_model.actuator.parameters import (
    CONTROLLER_KINDS,
    INVERSE_PLACES,
    INVERTER_KINDS,
    SECTIONS,
    WINDING_PLACES,
    check_value_is_read,
    drives_of,
    layout,
    numbers,
    says_drive,
    unread,
)
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError
from ema_model.faults import HEALTHY, vector
from ema_model.identification.search import Objective
from ema_model.kernels import inverse
from ema_model.models import ClosedLoop, InverseDynamics
from ema_model.recordings import Measurement
from ema_model.recordings.read import prepared
from ema_model.stacks import PLACES

BASE = {
    "controller.position_gain_1_s": 2e4,
    "controller.speed_limit_rad_s": 200.0,
    "controller.speed_gain_Nms_rad": 0.05,
    "controller.integral_gain_Nm_rad": 1.0,
    "controller.derivative_gain_Nms2_rad": 1e-6,
    "controller.integrator_window_rad": 4e-3,
    "controller.torque_constant_Nm_A": 0.0752,
    "controller.current_limit_A": 20.0,
    "controller.gain_1_rad": 200.0,
    "controller.output_limit": 0.9,
    "inverter.bus_voltage_V": 24.0,
    "inverter.hysteresis_band_A": 0.5,
    "inverter.current_limit_A": 12.0,
    "motor.torque_constant_Nm_A": 0.0752,
    "motor.inertia_kgm2": 1.3e-5,
    "motor.viscous_friction_Nms_rad": 1e-5,
    "motor.static_friction_Nm": 0.1,
    "motor.dynamic_friction_Nm": 0.05,
    "motor.resistance_Ohm": 2.13,
    "motor.inductance_H": 7.2e-4,
    "motor.emf_scale": 1.4,
    "motor.pole_pairs": 2.0,
    "motor.torque_limit_Nm": 0.4,
    "motor.rotor_offset_rad": 0.1,
    "transmission.gear_ratio": 0.002,
    "transmission.backlash_rad": 1e-5,
    "transmission.viscous_friction_Nms_rad": 5e-6,
    "transmission.stop_low_rad": -0.006,
    "transmission.stop_high_rad": 0.006,
    "sensors.current_gain": 1.02,
    "sensors.current_bias_A": 0.1,
    "sensors.delay_s": 1e-3,
    "sensors.apparent_inertia": 0.05,
}
FAULTY = vector({"k3": 0.3, "k6": 0.2})  # so that the rotor's angle matters
# Where the Monitor Model of a hysteresis drive leaves a key out by design, which its twin, the Reference Model, reads.
REFERENCE_ONLY = ("inverter.hysteresis_band_A", "transmission.viscous_friction_Nms_rad")
THESIS_ONLY = ("motor.emf_scale",)  # the thesis's circuit has the thesis's constants
KINDS = [
    (controller, inverter)
    for controller, inverter in product(CONTROLLER_KINDS, INVERTER_KINDS)
    if (controller, inverter) not in (("position", "hysteresis"), ("cascade", "voltage"))
    and inverter in drives_of(controller)
]
CIRCUITS = [(c, i, circuit) for c, i in KINDS for circuit in (("reduced", "thesis") if i == "hysteresis" else ("",))]
COMPILED = ("cascade", "hysteresis"), ("cascade", "current"), ("unknown", "current")  # for other tests as well
WALK = [
    (*kinds, f"{section}.{name}")
    for kinds in CIRCUITS
    for section in SECTIONS
    for name in numbers(section)
    if name in sum(layout(section, {"controller": kinds[0], "inverter": kinds[1]}), ())
]


def text(controller: str, inverter: str, values: dict[str, Any], extra: str = "") -> str:
    """An actuator file of these kinds with all that it may say, but for what is refused."""
    kinds = {"controller": controller, "inverter": inverter}
    silent = unread(controller, inverter)
    lines = []
    for section in SECTIONS:
        lines.append(f"[{section}]")
        if section in kinds and (section != "inverter" or says_drive(controller, inverter)):
            lines.append(f'kind = "{kinds[section]}"')
        for name in sum(layout(section, kinds), ()):
            path = f"{section}.{name}"
            if path in values or path not in silent:
                lines.append(f"{name} = {values.get(path, BASE[path])}")
    return "\n".join([*lines, extra, ""])


@pytest.fixture
def load(tmp_path):
    def read(controller: str, inverter: str, values: dict[str, Any], extra: str = ""):
        path = tmp_path / "mine.toml"
        path.write_text(text(controller, inverter, values, extra), encoding="utf-8")
        return load_actuator(path)

    return read


def recordings() -> list[Measurement]:
    """Small moves with dwells, a fast sine to both limits and both end stops, with a load; signals are of any size."""
    time = np.arange(0.0, 0.25, 2e-4)
    small = 2e-3 * np.sin(2 * np.pi * 6.0 * time) * (np.sin(2 * np.pi * 2.0 * time) > -0.3)
    large = 0.02 * np.sin(2 * np.pi * 8.0 * time + 0.3)
    found = []
    for command, load in ((small, 20.0), (large, 5.0)):
        motor = 500.0 * command
        signals = {"command_rad": command, "user_position_rad": command, "motor_position_rad": motor}
        signals |= {"motor_speed_rad_s": np.gradient(motor, time), "load_torque_Nm": np.full_like(time, load)}
        found.append(Measurement({"time_s": time, "current_A": np.ones_like(time), **signals}))
    return found


RECORDINGS = recordings()
# For an open loop: currents that move the motor, to the limits and the end stops and back.
PUSHED = [
    one.with_signals(current_A=size * np.sin(2.0 * np.pi * rate * one.time_s))
    for one, size, rate in zip(RECORDINGS, (4.0, 16.0), (15.0, 25.0))
]
# The same by what a voltage drive puts in: volts, and a share of the bus voltage, which alone needs to know it.
SUPPLIED = [
    RECORDINGS[0].with_signals(motor_voltage_V=20.0 * np.sin(2.0 * np.pi * 8.0 * RECORDINGS[0].time_s)),
    RECORDINGS[1].with_signals(duty=0.3 * np.sin(2.0 * np.pi * 15.0 * RECORDINGS[1].time_s)),
]


def said(actuator, circuit: str) -> list[np.ndarray]:
    """All signals of the model that recordings of this actuator are held against, healthy and faulty."""
    pushed = SUPPLIED if actuator.takes_voltage else PUSHED
    plant: Any = (  # each knows its own windows
        InverseDynamics(RECORDINGS, actuator)
        if actuator.controller.kind == "unknown"
        else ClosedLoop(
            pushed if actuator.controller.kind == "open" else RECORDINGS, actuator, circuit=circuit or "reduced"
        )
    )
    k = np.stack([HEALTHY, FAULTY])
    return [values for i in range(len(plant.windows)) for values in plant.signals(i, k=k).values()]


def current_of_phases(actuator) -> np.ndarray:
    """The equivalent current of three phases that were recorded beside the motor's angle."""
    phases = {f"phase_{name}_current_A": np.cos(40.0 * RECORDINGS[0].time_s + i) for i, name in enumerate("abc")}
    bare = {name: RECORDINGS[0][name] for name in ("time_s", "motor_position_rad")}
    return prepared(Measurement(bare | phases), actuator)["current_A"]


def moved(before: list[np.ndarray], after: list[np.ndarray]) -> float:
    """Largest change of a signal, relative to its size."""
    return max(
        1.0 if a.shape != b.shape else float(np.max(np.abs(a - b)) / max(np.max(np.abs(a)), 1e-9))
        for a, b in zip(before, after)
    )


def sensible_step(path: str) -> float:
    if path == "motor.pole_pairs":
        return 3.0
    return (0.5 if "limit" in path else 1.3) * BASE[path]


@pytest.mark.parametrize(
    ("controller", "inverter", "circuit", "path"),
    [pytest.param(*one, marks=() if one[:2] in COMPILED and "thesis" not in one else pytest.mark.long) for one in WALK],
    ids=["-".join(one) for one in WALK],
)
def test_key_changes_the_fitted_model_or_is_refused(load, controller, inverter, circuit, path):
    value = sensible_step(path)
    reason = unread(controller, inverter).get(path)
    if reason is not None:
        with pytest.raises(InputError) as refused:
            load(controller, inverter, {path: value})
        assert path in str(refused.value) and reason in str(refused.value) and "\n" not in str(refused.value)
        return
    if (controller, path) == ("unknown", "motor.pole_pairs"):  # not the model's: with it phases' currents are read
        one, other = (current_of_phases(load(controller, inverter, v)) for v in ({}, {path: value}))
        assert np.max(np.abs(one - other)) > 0.1
        return
    # static friction tells in inverse dynamics by Stribeck's law alone, since what stands there is left out
    extra = "[effects.stribeck_friction]\n" if (controller, path) == ("unknown", "motor.static_friction_Nm") else ""
    before, after = (load(controller, inverter, v, extra) for v in ({}, {path: value}))
    change = moved(said(before, circuit), said(after, circuit))
    if inverter == "hysteresis" and (path in REFERENCE_ONLY or (circuit == "thesis" and path in THESIS_ONLY)):
        assert change == 0.0, "listed as left out, but it acts"
    else:
        assert change > 1e-6, f"{path} reaches nothing in the model that is fitted"


def test_walk_has_every_parameter_of_every_kind():
    assert {path for *_, path in WALK} == {f"{section}.{name}" for section in SECTIONS for name in numbers(section)}
    for kinds in KINDS:
        everything = {f"{section}.{name}" for section in SECTIONS for name in numbers(section)}
        allowed = {path for controller, inverter, _, path in WALK if (controller, inverter) == kinds}
        assert everything - allowed <= set(unread(*kinds)), "a key that a file may not have has a reason why"


@pytest.mark.parametrize("kinds", KINDS, ids="-".join)
def test_refused_keys_may_stand_at_their_default(load, tmp_path, kinds):
    actuator = load(*kinds, {})
    for path in unread(*kinds):
        neutral = getattr(SECTIONS[path.partition(".")[0]], path.partition(".")[2])
        check_value_is_read(actuator.controller.kind, actuator.inverter.kind, actuator.axes, path, neutral, "here")
        if path.startswith(("motor.", "transmission.", "sensors.")):
            assert actuator.with_values({path: neutral}) == actuator
        with pytest.raises(InputError, match=path):
            actuator.with_values({path: 0.77})
    save_actuator(actuator, tmp_path / "again.toml")
    assert load_actuator(tmp_path / "again.toml") == actuator


@pytest.mark.parametrize(
    ("kinds", "extra", "says"),
    [
        (("position", "voltage"), "", None),
        (("cascade", "current"), "[effects.dead_time]\n", "effects.dead_time: an ideal current source has no winding"),
        (("cascade", "current"), "[effects.demagnetisation]\n", None),
        (("unknown", "current"), "[effects.position_sensor_delay]\n", "inverse dynamics does not simulate"),
        (("unknown", "current"), "[effects.torsional_compliance]\n", "inverse dynamics does not simulate"),
        (("unknown", "current"), "[effects.cogging_torque]\n", None),
        (("unknown", "current"), "[model]\nstep_s = 1e-4\n", "model.step_s"),
        (("unknown", "current"), "[model]\nfilter_s = 1e-2\n", None),
        (("position", "voltage"), "[model]\nfilter_s = 1e-2\n", "model.filter_s"),
        (
            ("position", "voltage"),
            '[[recordings.where]]\nmatch = "*"\nset = { "controller.integral_gain_Nm_rad" = 5 }\n',
            "controller.integral_gain_Nm_rad: a position controller has no speed loop",
        ),
    ],
)
def test_what_else_a_file_says_acts_or_is_refused(load, kinds, extra, says):
    if says is None:
        load(*kinds, {}, extra)
    else:
        with pytest.raises(InputError) as refused:
            load(*kinds, {}, extra)
        assert says in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("kinds", "path", "value", "says"),
    [
        (
            ("cascade", "hysteresis"),
            "inverter.hysteresis_band_A",
            "{ value = 0.5, tolerance = 0.1 }",
            "cannot have a tolerance",
        ),
        (("cascade", "current"), "motor.resistance_Ohm", "{ value = 1.0, tolerance = 0.1 }", "cannot have a tolerance"),
        (("cascade", "hysteresis"), "transmission.viscous_friction_Nms_rad", "1e-3", "add it to motor.viscous"),
    ],
)
def test_a_reason_is_given(load, kinds, path, value, says):
    with pytest.raises(InputError, match=says) as refused:
        load(*kinds, {path: value})
    assert path.partition(".")[2] in str(refused.value) and "\n" not in str(refused.value)


def test_a_key_that_the_kind_has_not_is_refused_with_the_reason_in_the_axis_s_own_words(tmp_path):
    path = tmp_path / "mine.toml"
    linear = '[axes]\nmotor = "linear"\n[controller]\nkind = "position"\ngain_1_rad = 1.0\nintegral_gain_N_m = 5.0\n'
    path.write_text(linear + '[inverter]\nkind = "voltage"\nbus_voltage_V = 24.0\n', encoding="utf-8")
    with pytest.raises(InputError, match="'integral_gain_N_m': a position controller has no speed loop") as refused:
        load_actuator(path)
    assert "\n" not in str(refused.value)


def test_places_are_those_that_the_kernels_have():
    imported = {
        name.name
        for node in ast.walk(ast.parse(inspect.getsource(inverse)))
        if isinstance(node, ast.ImportFrom) and node.module == "composition"
        for name in node.names
    }
    assert imported == set(INVERSE_PLACES) and set(WINDING_PLACES) < set(PLACES)
    assert all(function.__name__ in PLACES for effect in CATALOGUE.values() for function in effect.places)


def test_a_recording_s_own_values_reach_the_identification(load):
    """They are set by its name, and `plant.signals` has them: so must the fitness that the optimisers see."""
    rule = '[[recordings.where]]\nmatch = "stiff"\nset = { "controller.integral_gain_Nm_rad" = 9.0 }\n'
    ruled, bare = load("cascade", "hysteresis", {}, rule), load("cascade", "hysteresis", {})
    stiff = bare.with_values({"controller.integral_gain_Nm_rad": 9.0})
    named = [Measurement(dict(RECORDINGS[0].signals), name=name) for name in ("soft", "stiff")]
    together = Objective(named, ruled)
    soft, hard = Objective(named[:1], bare), Objective(named[1:], stiff)
    assert abs(soft(HEALTHY)[0] - hard(HEALTHY)[0]) > 1e-6
    np.testing.assert_array_equal(
        together.currents(HEALTHY), np.concatenate([soft.currents(HEALTHY), hard.currents(HEALTHY)], axis=1)
    )
    assert together(HEALTHY)[0] == pytest.approx(np.sqrt(0.5 * (soft(HEALTHY)[0] ** 2 + hard(HEALTHY)[0] ** 2)))
