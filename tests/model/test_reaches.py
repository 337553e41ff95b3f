"""Every number that a user can set changes something: actuator, faults, effects, sensors."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from ema_model.actuator import load_actuator, paths
from ema_model.commands import command
from ema_model.effects import CATALOGUE
from ema_model.faults import NAMES, vector
from ema_model.identification.search import Objective
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference

ACTUATOR = load_actuator()
FAULTY = vector({"k3": 0.3, "k6": 0.2})  # so that the rotor's angle matters
CHIRP = Run(command("chirp"), 0.1, load_torque_Nm=10.0)
SATURATING = Run(command("step"), 0.2)
BACK = Run(command("step", {"final_rad": -1.0}), 0.1)
SMALL = Run(command("step", {"final_rad": 1e-3}), 0.1, load_torque_Nm=40.0)
DWELLS = Run(command("staircase", {"step_rad": 5e-3, "dwell_s": 0.04}), 0.2, load_torque_Nm=10.0)

INTEGRAL = {"controller.integral_gain_Nm_rad": 5.0}
# Where a parameter matters, if not in the chirp: the run, what is set beside it, and its changed value.
WHERE = {
    "controller.speed_limit_rad_s": (SATURATING, {}, 300.0),
    "controller.integral_gain_Nm_rad": (SMALL, {}, 5.0),
    "controller.derivative_gain_Nms2_rad": (CHIRP, {}, 1e-7),
    "controller.integrator_window_rad": (SMALL, INTEGRAL, 1e-5),
    "controller.current_limit_A": (SATURATING, {}, 15.0),
    "inverter.bus_voltage_V": (SATURATING, {}, 40.0),
    "motor.resistance_Ohm": (SATURATING, {}, 3.0),
    "motor.inductance_H": (SATURATING, {}, 1.5e-3),
    "motor.emf_scale": (SATURATING, {}, 2.0),
    "motor.torque_limit_Nm": (SATURATING, {}, 1.0),
    "motor.pole_pairs": (CHIRP, {}, 3.0),
    "motor.rotor_offset_rad": (CHIRP, {}, 0.3),
    "transmission.stop_high_rad": (SATURATING, {}, 0.02),
    "transmission.stop_low_rad": (BACK, {}, -0.02),
    "transmission.backlash_rad": (CHIRP, {}, 2e-4),
}
# The Monitor Model leaves these out by design (T 3.3): its inverter is ideal, and its drag the motor's alone.
ONLY_REFERENCE = {
    "inverter.hysteresis_band_A": "the Monitor Model has no hysteresis relays",
    "transmission.viscous_friction_Nms_rad": "the Monitor Model's drag is the motor's alone",
}
MODELS = {"reference": simulate_reference, "monitor": simulate_monitor}
SIGNALS = ("current_A", "motor_position_rad", "motor_speed_rad_s", "user_position_rad")
_LEAST = 1e-6  # of a signal's size
# Effects' parameters that by design act in one of the models only: (effect.parameter, model): reason.
EFFECTS_IN_ONE: dict[tuple[str, str], str] = {}


def change(a, b) -> float:
    """Largest change of a signal, relative to its size."""
    return max(float(np.max(np.abs(a[s] - b[s])) / max(np.max(np.abs(a[s])), 1e-12)) for s in SIGNALS)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("path", [p for p in paths() if not p.startswith("sensors.")])
def test_actuator_parameter_reaches(path, model):
    run, beside, value = WHERE.get(path, (CHIRP, {}, 1.3 * ACTUATOR.value(path)))
    base = ACTUATOR.with_values(beside)
    assert base.value(path) != value
    simulate = MODELS[model]
    before = simulate(run, base, FAULTY)
    after = simulate(run, base.with_values({path: value}), FAULTY)
    if model == "monitor" and path in ONLY_REFERENCE:
        assert change(before, after) == 0.0, "listed as acting in the reference model only, but it acts here too"
    else:
        assert change(before, after) > _LEAST, f"{path} reaches nothing in the {model} model"


def test_lists_name_existing_parameters():
    assert set(WHERE) | set(ONLY_REFERENCE) <= set(paths())
    assert all(name.partition(".")[0] in CATALOGUE for name, _ in EFFECTS_IN_ONE)


@pytest.mark.long
def test_emf_scale_sets_the_reduced_circuit_only():
    """The thesis's circuit has the thesis's own constants."""
    changed = ACTUATOR.with_values({"motor.emf_scale": 2.0})
    same = [simulate_monitor(SATURATING, a, circuit="thesis") for a in (ACTUATOR, changed)]
    assert change(*same) == 0.0


@pytest.mark.parametrize("path", [p for p in paths() if p.startswith("sensors.")])
def test_sensor_parameter_reaches_the_objective(path):
    """A recording that a sensor distorted fits best with that sensor's parameter, about as well as the true one."""
    value = {"sensors.current_gain": 1.1, "sensors.current_bias_A": 0.3, "sensors.delay_s": 1e-3}[path]
    true = simulated(CHIRP, ACTUATOR, FAULTY)
    current, time = true["current_A"], true.time_s
    if path == "sensors.delay_s":  # the command of earlier times moves the actuator
        seen = true.with_signals(current_A=np.interp(time - value, time, current))
    elif path == "sensors.current_gain":
        seen = true.with_signals(current_A=value * current)
    else:
        seen = true.with_signals(current_A=current + value)
    clean = Objective([true], ACTUATOR)(FAULTY)[0]
    ignored = Objective([seen], ACTUATOR)(FAULTY)[0]
    told = Objective([seen], ACTUATOR.with_values({path: value}))(FAULTY)[0]
    assert told == pytest.approx(clean, rel=0.15)
    assert ignored > 1.5 * told, f"{path} reaches nothing in the objective"


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", NAMES)
def test_fault_reaches(name, model):
    base = {"k6": 0.3} if name == "k7" else {}
    before = MODELS[model](CHIRP, ACTUATOR, vector(base))
    after = MODELS[model](CHIRP, ACTUATOR, vector({**base, name: 0.65}))
    assert change(before, after) > 1e-4


def test_load_reaches_both_models():
    for simulate in MODELS.values():
        runs = [simulate(Run(command("chirp"), 0.2, load_torque_Nm=load), ACTUATOR) for load in (0.0, 10.0)]
        assert change(*runs) > 1e-3


def other_value(parameter):
    """A value inside the parameter's range, well away from its default."""
    low, high, default = parameter.low, parameter.high, parameter.default
    value = default + 0.25 * (high - default) if high - default >= default - low else default - 0.25 * (default - low)
    if not parameter.integer:
        return value
    return min(round(high), max(round(low), round(value))) if round(value) != default else default + 1.0


EFFECT_PARAMETERS = [(e.name, p.name) for e in CATALOGUE.values() for p in e.parameters]
RUNS = {"chirp": CHIRP, "saturating": SATURATING, "dwells": DWELLS}


@cache
def with_effect(model, run, effect="", **settings):
    """A model's signals of one of `RUNS`, with an effect."""
    return MODELS[model](RUNS[run], ACTUATOR, effects={effect: settings} if effect else {})


def moves(model, effect, settings, others):
    """The change between two settings of an effect ({}: without it), one run after another."""
    for run in RUNS:
        before = with_effect(model, run, effect, **settings) if settings else with_effect(model, run)
        yield change(before, with_effect(model, run, effect, **others))


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("effect", "parameter"), EFFECT_PARAMETERS, ids=[f"{e}.{p}" for e, p in EFFECT_PARAMETERS])
def test_effect_parameter_reaches(effect, parameter, model):
    declared = CATALOGUE[effect]
    clear = {declared.parameters[0].name: declared.severities[1]}
    named = next(p for p in declared.parameters if p.name == parameter)
    value = declared.severities[2] if parameter == declared.parameters[0].name else other_value(named)
    changes = moves(model, effect, clear, {**clear, parameter: value})
    if (f"{effect}.{parameter}", model) in EFFECTS_IN_ONE:
        assert max(changes) == 0.0
    else:
        assert any(one > 1e-5 for one in changes), f"{effect}.{parameter} reaches nothing in the {model} model"


@pytest.mark.parametrize("effect", CATALOGUE)
def test_effect_severities_act_more_and_more(effect):
    """Each severity stands inside its range and differs from no effect."""
    declared = CATALOGUE[effect]
    first = declared.parameters[0]
    assert first.low <= declared.severities[0] and declared.severities[2] <= first.high
    assert len(set(declared.severities)) == 3
    for severity in declared.severities:
        for model in MODELS:
            changes = moves(model, effect, {}, {first.name: severity})
            assert any(one > 1e-5 for one in changes) or (f"{effect}.{first.name}", model) in EFFECTS_IN_ONE
