"""Every parameter has the name and unit of the axis that it acts at: of the motor, of the user, or of none."""

from __future__ import annotations

import subprocess
import sys
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ema_model.actuator import Actuator, Tolerance, load_actuator, save_actuator
from ema_model.actuator.parameters import SECTIONS, numbers, on_axes, path_inside
from ema_model.effects import CATALOGUE, Parameter, find
from ema_model.errors import InputError
from ema_model.estimation.problem import unknowns_of
from ema_model.models.inverse_dynamics import InverseDynamics
from ema_model.models.loop_window import cut
from ema_model.quantities import Axes
from ema_model.recordings import Measurement
from ema_model.recordings.health import health
from ema_model.recordings.read import check_needed, prepared
from ema_model.simulation.run import Run, finite, run_in_words
from emaviz.cli.flow import effects_of
from emaviz.figures.runs import charts

PROJECT = Path(__file__).parents[2]
ROTARY, LINEAR = Axes(), Axes("linear", "linear")
SCREW = Axes("rotary", "linear")  # a motor that turns, a nut that slides
RACK = Axes("linear", "rotary")

# What each parameter is measured in where its side turns, and where it slides: from the equations of MODEL.
TURN_SLIDE = {
    "angle": ("rad", "m"),
    "speed": ("rad/s", "m/s"),
    "torque": ("N·m", "N"),
    "stiffness": ("N·m/rad", "N/m"),
    "cubic stiffness": ("N·m/rad³", "N/m³"),
    "damping": ("N·m·s/rad", "N·s/m"),
    "derivative": ("N·m·s²/rad", "N·s²/m"),
    "constant": ("N·m/A", "N/A"),
    "inertia": ("kg·m²", "kg"),
    "share per angle": ("1/rad", "1/m"),
}
AT_MOTOR = {
    "controller.speed_limit_rad_s": "speed",
    "controller.speed_gain_Nms_rad": "damping",
    "controller.integral_gain_Nm_rad": "stiffness",
    "controller.derivative_gain_Nms2_rad": "derivative",
    "controller.torque_constant_Nm_A": "constant",
    "motor.torque_constant_Nm_A": "constant",
    "motor.inertia_kgm2": "inertia",
    "motor.viscous_friction_Nms_rad": "damping",
    "motor.static_friction_Nm": "torque",
    "motor.dynamic_friction_Nm": "torque",
    "motor.torque_limit_Nm": "torque",
    "motor.rotor_offset_rad": "angle",
    "transmission.viscous_friction_Nms_rad": "damping",
    "effects.acceleration_feedforward.inertia_kgm2": "inertia",
    "effects.asymmetric_friction.viscous_part_Nms_rad": "damping",
    "effects.cogging_torque.amplitude_Nm": "torque",
    "effects.dry_friction.torque_Nm": "torque",
    "effects.encoder_eccentricity.amplitude_rad": "angle",
    "effects.presliding_friction.stiffness_Nm_rad": "stiffness",
    "effects.presliding_friction.damping_Nms_rad": "damping",
    "effects.power_law_drag.speed_rad_s": "speed",
    "effects.quadratic_drag.speed_rad_s": "speed",
    "effects.screw_lead_error.period_rad": "angle",
    "effects.stribeck_friction.speed_rad_s": "speed",
    "effects.saturating_friction.half_speed_rad_s": "speed",
    "effects.viscous_friction.coefficient_Nms_rad": "damping",
    "turned 0": "angle",
    "play 0": "angle",
    "faster 0": "speed",
}
AT_USER = {
    "controller.integrator_window_rad": "angle",
    "controller.gain_1_rad": "share per angle",
    "transmission.backlash_rad": "angle",
    "transmission.stop_low_rad": "angle",
    "transmission.stop_high_rad": "angle",
    "effects.constant_load.torque_Nm": "torque",
    "effects.hinge_moment.stiffness_Nm_rad": "stiffness",
    "effects.hinge_moment.offset_Nm": "torque",
    "effects.pendulum_load.moment_Nm": "torque",
    "effects.pendulum_load.angle_rad": "angle",
    "effects.cubic_spring.stiffness_Nm_rad3": "cubic stiffness",
    "effects.dead_band.half_width_rad": "angle",
    "effects.friction_zone.begin_rad": "angle",
    "effects.friction_zone.end_rad": "angle",
    "effects.goal_rate_limit.rate_rad_s": "speed",
    "effects.one_sided_spring.contact_rad": "angle",
    "effects.one_sided_spring.stiffness_Nm_rad": "stiffness",
    "effects.position_sensor_eccentricity.amplitude_rad": "angle",
    "effects.position_sensor_nonlinearity.curvature_1_rad": "share per angle",
    "effects.position_sensor_bias.bias_rad": "angle",
    "effects.screw_lead_error.amplitude_rad": "angle",
    "effects.torsional_compliance.stiffness_Nm_rad": "stiffness",
    "effects.torsional_compliance.damping_Nms_rad": "damping",
    "effects.torsional_compliance.inertia_kgm2": "inertia",
    "load 0": "torque",
}
OF_BOTH = {  # on a rotary, a linear, a screw's and a rack's axes
    "controller.position_gain_1_s": ("1/s", "1/s", "rad/(m·s)", "m/(rad·s)"),
    "effects.friction_drift.rate_1_s": ("1/s", "1/s", "1/s", "1/s"),
    "effects.resistance_drift.rate_1_s": ("1/s", "1/s", "1/s", "1/s"),
    "effects.speed_loop_integral.rate_1_s": ("1/s", "1/s", "1/s", "1/s"),
    "effects.torque_saturation.saturation_1_A": ("1/A", "1/A", "1/A", "1/A"),
    "lag 0": ("s", "s", "s", "s"),
    "transmission.gear_ratio": ("", "", "m/rad", "rad/m"),
    "effects.cogging_torque.order": ("", "rad/m", "", "rad/m"),
    "effects.torque_ripple.order": ("", "rad/m", "", "rad/m"),
    "effects.position_dependent_friction.order": ("", "rad/m", "", "rad/m"),
}
OF_NONE = {"A": "A", "V": "V", "H": "H", "s": "s", "Ohm": "Ω", "rad": "rad", "": ""}  # by the name's ending
PATHS = [f"{section}.{name}" for section in SECTIONS for name in numbers(section)]
PATHS += [f"effects.{name}.{p.name}" for name, effect in CATALOGUE.items() for p in effect.parameters]


def expected(path: str, axes: Axes) -> str:
    """The unit, by the tables above."""
    if path in OF_BOTH:
        return OF_BOTH[path][[ROTARY, LINEAR, SCREW, RACK].index(axes)]
    for table, kind in ((AT_MOTOR, axes.motor), (AT_USER, axes.user)):
        if path in table:
            return TURN_SLIDE[table[path]][kind == "linear"]
    assert path.endswith("phase_rad") or "_rad" not in path, f"{path} is in no table above"
    return OF_NONE.get(path.rpartition("_")[2], "") if "_" in path.rpartition(".")[2] else ""


@pytest.mark.parametrize("axes", [ROTARY, LINEAR, SCREW, RACK], ids=["rotary", "linear", "screw", "rack"])
@pytest.mark.parametrize("path", [*PATHS, "turned 0", "play 0", "load 0", "lag 0"])
def test_a_parameter_has_the_unit_of_the_side_it_acts_at(path, axes):
    assert on_axes(path, axes).unit == expected(path, axes)


@pytest.mark.parametrize("axes", [LINEAR, SCREW, RACK], ids=["linear", "screw", "rack"])
def test_names_stay_apart_and_rotary_ones_are_those_inside(axes):
    assert [on_axes(path, ROTARY).path for path in PATHS] == PATHS
    shown = [on_axes(path, axes).path for path in PATHS]
    assert len(set(shown)) == len(PATHS)
    for path, name in zip(PATHS, shown):
        assert (path == name) == (expected(path, axes) == expected(path, ROTARY) or path in OF_BOTH), (path, name)
    assert on_axes("effects.torsional_compliance.inertia_kgm2", SCREW).title == "Torsional compliance: mass"
    assert on_axes("effects.cogging_torque_2.amplitude_Nm", LINEAR).unit == "N"


def test_a_parameter_that_leaves_its_side_open_is_refused_where_it_is_written():
    with pytest.raises(ValueError, match="stiffness_Nm_rad: say where it sits"):
        Parameter("stiffness_Nm_rad", "stiffness", 1.0, 0.0, 2.0)
    assert Parameter("ratio", "a share", 0.1, 0.0, 1.0).unit == ""


@pytest.mark.parametrize("name", CATALOGUE)
def test_ranges_are_of_the_axis(name):
    """A speed of 10 rad/s is usual, one of 10 m/s is not; a motor that turns keeps its range whatever the user does."""
    rotary, linear, screw = (find(name, axes) for axes in (ROTARY, LINEAR, SCREW))
    assert rotary == find(name)
    for at, there, mixed in zip(rotary.parameters, linear.parameters, screw.parameters):
        assert there.low <= there.default <= there.high
        if at.side == "motor" or at.per == "motor":
            assert (mixed.default, mixed.low, mixed.high) == (at.default, at.low, at.high)
            assert (there.default, there.low, there.high) != (at.default, at.low, at.high)
    for severity in linear.severities:
        linear.settings({linear.parameters[0].name: severity})
    stribeck = find("stribeck_friction", LINEAR)
    assert stribeck.parameters[0].high <= 1.0 and stribeck.severities[2] < 0.1
    with pytest.raises(InputError, match="speed_m_s = 10 is outside"):
        stribeck.settings({"speed_rad_s": 10.0})


AXIS = """
[axes]
motor = "{motor}"
user = "{user}"
[controller]
kind = "{kind}"
"""
OF_MOTOR = {
    "linear": "[motor]\nforce_constant_N_A = 20.0\nmass_kg = 2.0\nviscous_friction_Ns_m = 3.0\n"
    "static_friction_N = 0.0\ndynamic_friction_N = 5.0\n",
    "rotary": "[motor]\ntorque_constant_Nm_A = 0.1\ninertia_kgm2 = 1e-4\nviscous_friction_Nms_rad = 0.0\n"
    "static_friction_Nm = 0.0\ndynamic_friction_Nm = 0.01\n",
}
POSITION = '[inverter]\nkind = "current"\ncurrent_limit_A = 5.0\n'


def actuator(folder: Path, axes: Axes, kind: str = "unknown", more: str = "") -> Actuator:
    """One with these axes, its controller unknown or a position loop."""
    gain = "gain_1_m = 50.0\n" if axes.user == "linear" else "gain_1_rad = 50.0\n"
    text = AXIS.format(motor=axes.motor, user=axes.user, kind=kind) + (gain + POSITION if kind == "position" else "")
    (folder / "axis.toml").write_text(text + OF_MOTOR[axes.motor] + more, encoding="utf-8")
    return load_actuator(folder / "axis.toml")


def test_files_name_effects_by_the_side_they_act_at(tmp_path):
    effects = (
        "[effects.presliding_friction]\nstiffness_Nm_rad = 9.0\n[effects.stribeck_friction]\nspeed_rad_s = 3.0\n"
        "[effects.torsional_compliance]\nstiffness_N_m = 2e6\ndamping_Ns_m = 100.0\nmass_kg = 3.0\n"
    )
    screw = actuator(tmp_path, SCREW, "position", effects)
    assert screw.effects["torsional_compliance"]["inertia_kgm2"] == 3.0
    assert screw.effects["presliding_friction"]["stiffness_Nm_rad"] == 9.0
    save_actuator(screw, tmp_path / "again.toml")
    assert load_actuator(tmp_path / "again.toml").effects == screw.effects
    with pytest.raises(InputError, match=r"has no 'stiffness_N_m'; it has stiffness_Nm_rad, damping_Nms_rad"):
        actuator(tmp_path, SCREW, "position", effects.replace("stiffness_Nm_rad = 9.0", "stiffness_N_m = 9.0"))
    with pytest.raises(InputError, match=r"\[motor\] mass_kg must be above 0"):
        actuator(tmp_path, LINEAR).with_values({"motor.inertia_kgm2": -1.0})
    with pytest.raises(InputError, match="stop_low_m must be below stop_high_m"):
        actuator(tmp_path, SCREW, "position", "[transmission]\nstop_low_m = 1.0\nstop_high_m = 0.0\n")


def test_what_to_calibrate_is_named_as_in_the_file(tmp_path):
    slide = actuator(tmp_path, LINEAR)
    slide = replace(slide, tolerances={"motor.inertia_kgm2": Tolerance(0.1, False)})
    assert path_inside("motor.mass_kg", slide.tolerances, LINEAR) == "motor.inertia_kgm2"
    assert path_inside("k2", slide.tolerances, LINEAR) == "k2"
    assert unknowns_of(slide, ["motor.inertia_kgm2"])[0].nominal == 2.0
    with pytest.raises(InputError, match=r"free may be motor\.mass_kg$"):
        unknowns_of(slide, ["motor.dynamic_friction_Nm"])


TIME = np.linspace(0.0, 1.0, 500)
SENSED = {"time_s": TIME, "current_A": np.cos(9.0 * TIME)}
BLIND = {"current_A": None}


@pytest.mark.parametrize(
    ("axes", "kind", "recorded", "asked"),
    [
        (LINEAR, "unknown", {}, "motor_position_m"),
        (SCREW, "unknown", {}, "motor_position_rad"),
        (LINEAR, "position", {}, "command_m"),
        (SCREW, "position", {}, "command_m"),
        (RACK, "position", {}, "command_rad"),
        (LINEAR, "position", {"command_m": TIME, **BLIND}, "motor_speed_m_s, motor_position_m, user_position_m"),
        (SCREW, "position", {"command_m": TIME, **BLIND}, "motor_speed_rad_s, motor_position_rad, user_position_m"),
        (LINEAR, "unknown", {"motor_position_m": TIME, **BLIND}, "current_A or motor_force_N"),
    ],
)
def test_messages_ask_an_axis_for_its_own_signals(axes, kind, recorded, asked, tmp_path):
    given = {name: values for name, values in (SENSED | recorded).items() if values is not None}
    model = actuator(tmp_path, axes, kind)
    measurement = prepared(Measurement(given, name="slide"), model)
    with pytest.raises(InputError) as told:
        if kind == "unknown":
            InverseDynamics([measurement], model)
        else:
            cut(measurement, model)
    told = str(told.value)
    assert asked in told and (axes != LINEAR or "_rad" not in told)
    present = told.partition("(present: ")[2]
    assert axes != LINEAR or "_rad" not in present


def test_a_still_signal_is_named_as_its_file_has_it(tmp_path):
    still = Measurement({"time_s": TIME, "motor_position_m": np.zeros(500)}, name="slide")
    with pytest.raises(InputError, match="column 'motor_position_m' is constant"):
        check_needed(prepared(still, actuator(tmp_path, LINEAR)), "motor_position_rad")


@pytest.mark.parametrize(("axes", "unit"), [(LINEAR, "mm"), (SCREW, "mrad")])
def test_the_health_card_measures_a_motor_in_its_own_unit(axes, unit, tmp_path):
    name = f"motor_position_{unit[1:]}"
    way = np.round(0.5 * np.sin(9.0 * TIME) / 0.02) * 0.02
    found = health(prepared(Measurement({"time_s": TIME, name: way}, name="slide"), actuator(tmp_path, axes)))
    step = found.of("quantisation", name)
    assert step is not None and step.sentence == f"Motor position comes in steps of 20.0 {unit}."


def test_the_command_line_takes_effects_by_the_names_of_the_axes():
    given = Namespace(effect=["torsional_compliance:stiffness_N_m=5e7,mass_kg=3", "stribeck_friction:speed_rad_s=4"])
    screw = effects_of(given, SCREW)
    assert screw["torsional_compliance"]["stiffness_Nm_rad"] == 5e7
    assert screw["torsional_compliance"]["inertia_kgm2"] == 3.0 and screw["stribeck_friction"]["speed_rad_s"] == 4.0
    with pytest.raises(InputError, match="has no parameter 'speed_rad_s'; it has speed_m_s"):
        effects_of(given, LINEAR)


def test_a_run_is_drawn_in_the_units_of_the_axes():
    shown = {chart.signal: (chart.unit, chart.difference_unit) for chart in charts(SCREW)}
    assert shown["user_position_rad"] == ("mm", "µm") and shown["motor_position_rad"] == ("rad", "mrad")
    told = run_in_words("sine", {"amplitude_rad": 0.03, "frequency_Hz": 2.0}, 0.5, SCREW)
    assert told == "a sine with amplitude 0.03 m, frequency 2 Hz, for 0.5 s"


NEW_EFFECT = '''"""A rubber bumper."""

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, stiffness):
    """− τ K θ_user, added."""
    return torque - gear * stiffness * user


EFFECT = Effect(
    title="Rubber bumper",
    equation="T = − τ K θ_user",
    source="Hooke",
    explanation="It pushes back.",
    parameters=(Parameter("stiffness_Nm_rad", "stiffness K", 100.0, 0.0, 1e5, side=USER, linear=(1e4, 0.0, 1e8)),),
    severities=(50.0, 100.0, 200.0),
    places=(shaft_torque,),
    shows="in the current",
    mistaken_for="hinge moment",
    family="mechanics",
)
'''
ASKED = """
from ema_model.actuator import load_actuator
from ema_model.actuator.parameters import on_axes
from ema_model.effects import CATALOGUE
made = load_actuator("axis.toml")
one = on_axes("effects.rubber_bumper.stiffness_Nm_rad", made.axes)
print(len(CATALOGUE), one.path, one.title, one.unit, made.effects)
"""


def test_a_new_effect_at_the_user_is_one_file(tmp_path):
    """Nothing else knows of it, and a linear axis names and measures it rightly."""
    package = tmp_path / "ema_model"
    package.mkdir()
    for part in (PROJECT / "ema_model").iterdir():
        if part.name != "effects":
            (package / part.name).symlink_to(part)
    (package / "effects").mkdir()
    for part in (PROJECT / "ema_model" / "effects").iterdir():
        (package / "effects" / part.name).symlink_to(part)
    (package / "effects" / "rubber_bumper.py").write_text(NEW_EFFECT, encoding="utf-8")
    gain = AXIS.format(motor="rotary", user="linear", kind="position") + "gain_1_m = 50.0\n" + POSITION
    text = gain + OF_MOTOR["rotary"] + "[effects.rubber_bumper]\nstiffness_N_m = 5e6\n"
    (tmp_path / "axis.toml").write_text(text, encoding="utf-8")
    told = subprocess.run(
        [sys.executable, "-c", ASKED], cwd=tmp_path, env={"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True
    )
    assert told.stdout.strip() == (
        f"{len(CATALOGUE) + 1} effects.rubber_bumper.stiffness_N_m Rubber bumper: stiffness N/m "
        "{'rubber_bumper': {'stiffness_Nm_rad': 5000000.0}}"
    ), told.stderr


def test_a_run_that_diverges_names_the_axis_own_signal():
    with pytest.raises(FloatingPointError, match="command_m is not finite"):
        finite({"time_s": Run().time_s, "command_rad": np.full(Run().samples + 1, np.nan)}, "the model", SCREW)
