"""Effects of the drive's controller: what each must do in its limits, in lanes as alone, and in both models."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from ema_model.actuator import Actuator, load_actuator
from ema_model.actuator.parameters import Inverter, idle
from ema_model.commands import command
from ema_model.effects import CATALOGUE
from ema_model.effects.acceleration_feedforward import goal as accelerated
from ema_model.effects.acceleration_feedforward import loop_torque as pushed
from ema_model.effects.computation_delay import drive_output as delayed
from ema_model.effects.current_loop_lag import current_reference as lagged
from ema_model.effects.dead_band import position_error
from ema_model.effects.goal_delay import goal as goal_delayed
from ema_model.effects.goal_rate_limit import goal as limited
from ema_model.effects.sampled_control import drive_output as held
from ema_model.effects.sampled_control import speed_sample
from ema_model.effects.speed_loop_integral import integral_gain
from ema_model.faults import HEALTHY
from ema_model.physics.rows import LANES
from ema_model.simulation.pack import initial_state, library_stack, monitor_rows
from ema_model.simulation.run import NOTHING, Run, simulate_monitor

THESIS = load_actuator()
GEAR = THESIS.transmission.gear_ratio
DRIVE = [name for name, effect in CATALOGUE.items() if effect.family == "drive"]
IN_DRIVE = [name for name, effect in CATALOGUE.items() if effect.acts_in_drive]
SIGNALS = ("current_A", "motor_position_rad", "motor_speed_rad_s", "user_position_rad")
# An ideal current source: nothing chops, so that small changes stand out.
IDEAL = replace(THESIS, inverter=Inverter("current", current_limit_A=22.5))
CHIRP = Run(command("chirp"), 0.2, load_torque_Nm=10.0)
STEP = Run(command("step", {"final_rad": 5e-3}), 0.1)
DT = 1e-5


def simulated(run: Run, actuator: Actuator = IDEAL, /, **effects: float):
    """The Monitor Model's signals; effects: the first parameter of each, by name."""
    settings = {name: {CATALOGUE[name].parameters[0].name: value} for name, value in effects.items()}
    # Beside something that does nothing, so that all runs go in the library's kernels.
    return simulate_monitor(run, actuator, effects={"winding_resistance": {"ratio": 0.0}, **settings})


def apart(one, other, name: str = "motor_position_rad") -> float:
    return float(np.sqrt(np.mean((one[name] - other[name]) ** 2)))


def passed(stage, values, *parameters: float, states: int):
    """What a stage makes of a series of values."""
    own, out = [0.0] * states, []
    for n, value in enumerate(values):
        told, *own = stage(value, n == 0, DT, *parameters, *own)
        out.append(told)
    return np.array(out)


# --- each stage alone -----------------------------------------------------------------------------------------------

TIME = np.arange(3000) * DT
WAVE = np.sin(2.0 * np.pi * 100.0 * TIME + 0.3)


@pytest.mark.parametrize("delay", [3e-5, 1e-4, 4.37e-4, 2e-3])
def test_a_computation_delay_shifts_what_is_put_out(delay):
    late = passed(delayed, WAVE, delay, states=6)
    told = slice(round(4.0 / 3.0 * delay / DT) + 2, None)
    # linear between values a third of the delay apart, each between two steps
    bend = (2.0 * np.pi * 100.0) ** 2 * (max(delay / 3.0, 3.0 * DT) ** 2 + DT**2) / 8.0
    np.testing.assert_allclose(late[told], np.sin(2.0 * np.pi * 100.0 * (TIME - delay) + 0.3)[told], atol=bend + 1e-9)
    assert late[0] == WAVE[0]


def test_a_short_delay_grows_from_none():
    for delay in (1e-6, 1e-5, 2e-5):
        late = passed(delayed, WAVE, delay, states=6)[10:]
        assert np.max(np.abs(late - np.sin(2.0 * np.pi * 100.0 * (TIME - delay) + 0.3)[10:])) < 1e-4


@pytest.mark.parametrize("constant", [1e-4, 1e-3])
def test_a_current_loop_s_lag_is_that_of_first_order(constant):
    jump = np.r_[0.0, np.ones(2999)]
    expected = 1.0 - np.exp(-TIME / constant)
    np.testing.assert_allclose(passed(lagged, jump, constant, states=1), expected, atol=1.1 * DT / constant)


@pytest.mark.parametrize("period", [1e-4, 3.33e-4])
def test_a_drive_holds_its_output_and_takes_the_way_of_a_period_for_the_speed(period):
    angle, own, out, speeds = 0.0, [0.0] * 6, [], []
    for n, speed in enumerate(WAVE):
        told, *own = speed_sample(speed, n == 0, DT, period, *own)
        output, *own = held(float(n), n == 0, DT, period, *own)
        out.append(output)
        speeds.append(told)
        angle += DT * speed
    at = np.flatnonzero(np.diff(out)) + 1
    assert len(at) == pytest.approx(TIME[-1] / period, abs=1.0)
    assert np.all(np.abs(np.diff(at) - period / DT) < 1.0), "it keeps its rate, to a step"
    way = np.cumsum(WAVE) * DT
    for first, last in pairwise(at[3:20]):
        assert speeds[last] == pytest.approx((way[last] - way[first]) / ((last - first) * DT), abs=1e-9)


def test_a_dead_band_takes_its_width_off_either_side():
    assert [position_error(e, False, DT, 0.2) for e in (-0.5, -0.2, 0.1, 0.5)] == pytest.approx([-0.3, 0.0, 0.0, 0.3])


def test_an_integral_gain_never_turns_round():
    assert integral_gain(0.4, 0.01, 30.0) == pytest.approx(0.7)
    assert integral_gain(0.4, 0.01, -100.0) == 0.0


def test_a_goal_moves_no_faster_than_its_limit_and_arrives():
    jump = np.r_[0.0, np.full(2999, 0.02)]
    moved = passed(lambda goal, *rest: limited(goal, GEAR, *rest), jump, 1.0, states=1)
    np.testing.assert_allclose(moved, np.minimum(0.02, TIME), atol=2e-5)
    free = passed(lambda goal, *rest: limited(goal, GEAR, *rest), WAVE, 1e9, states=1)
    np.testing.assert_array_equal(free, WAVE)


@pytest.mark.parametrize("delay", [4e-3, 0.012])
def test_a_goal_s_delay_shifts_it(delay):
    slow = np.sin(2.0 * np.pi * 10.0 * TIME)
    late = passed(lambda goal, *rest: goal_delayed(goal, GEAR, *rest), slow, delay, states=6)
    told = slice(round(4.0 / 3.0 * delay / DT) + 2, None)
    bend = (2.0 * np.pi * 10.0) ** 2 * ((delay / 3.0) ** 2 + DT**2) / 8.0
    np.testing.assert_allclose(late[told], np.sin(2.0 * np.pi * 10.0 * (TIME - delay))[told], atol=bend + 1e-9)


def test_an_acceleration_is_fed_forward_as_its_torque():
    """Of a command at a constant acceleration a: J_f a/τ, after the smoothing, from whatever speed it begins at."""
    inertia, smoothing, rate = 2e-5, 1e-3, 40.0
    for begins_at in (0.0, 3.0):
        own, torque = [0.0] * 4, []
        for n, at in enumerate(TIME):
            told, *own = accelerated(begins_at * at + 0.5 * rate * at**2, GEAR, n == 0, DT, inertia, smoothing, *own)
            torque.append(pushed(0.1, n == 0, DT, inertia, smoothing, *own)[0])
        assert told == begins_at * TIME[-1] + 0.5 * rate * TIME[-1] ** 2
        rise = 0.1 + inertia * rate / GEAR * (1.0 - np.exp(-TIME / smoothing))
        np.testing.assert_allclose(torque, rise, atol=0.02 * inertia * rate / GEAR)


# --- in the loop ----------------------------------------------------------------------------------------------------


def test_with_all_of_its_speed_fed_forward_a_motor_does_not_trail_a_ramp():
    """It does by its speed over the position gain without, and by a share of that in proportion."""
    ramp = Run(command("ramp", {"slope_rad_s": 0.2}), 0.2)
    trails = []
    for share in (0.0, 0.5, 1.0):
        run = simulated(ramp, velocity_feedforward=share) if share else simulated(ramp)
        trails.append(float(np.mean((run["command_rad"] - run["user_position_rad"])[-200:])))
    friction = trails[2]  # what friction takes is left
    assert trails[0] - friction == pytest.approx(0.2 / (IDEAL.controller.position_gain_1_s * GEAR), rel=0.02)
    assert trails[1] - friction == pytest.approx(0.5 * (trails[0] - friction), rel=0.02)


def test_a_goal_s_gain_is_the_command_s():
    scaled = Run(command("step", {"final_rad": 1.04 * 5e-3}), 0.1)
    one, other = simulated(STEP, goal_gain=0.04), simulated(scaled)
    for name in SIGNALS:
        np.testing.assert_allclose(one[name], other[name], atol=1e-9 * np.max(np.abs(other[name])))


@pytest.mark.long
@pytest.mark.parametrize("name", ["computation_delay", "sampled_control", "speed_filter", "current_loop_lag"])
def test_the_shorter_the_less(name):
    """In proportion: what is twice as late moves the motor about twice as far."""
    plain = simulated(CHIRP)
    moved = [apart(simulated(CHIRP, **{name: time}), plain) for time in (5e-5, 1e-4, 2e-4)]
    assert moved[0] > 0.0
    assert moved[1] / moved[0] == pytest.approx(2.0, rel=0.35) and moved[2] / moved[1] == pytest.approx(2.0, rel=0.35)


@pytest.mark.long
def test_a_rate_beyond_the_model_s_steps_is_continuous():
    plain, fast = simulated(CHIRP), simulated(CHIRP, sampled_control=DT)
    for name in SIGNALS:
        np.testing.assert_array_equal(fast[name], plain[name])


def test_gains_are_those_of_the_file():
    """An effect of a gain is the file's gain at the changed value."""
    for effect, value, path, changed in (
        ("speed_loop_gain", 0.5, "controller.speed_gain_Nms_rad", 0.075),
        ("speed_loop_integral", 100.0, "controller.integral_gain_Nm_rad", 5.0),
    ):
        by_file, by_effect = simulated(STEP, IDEAL.with_values({path: changed})), simulated(STEP, **{effect: value})
        assert apart(by_effect, simulated(STEP)) > 0.0
        for name in SIGNALS:
            size = np.max(np.abs(by_file[name]))
            np.testing.assert_allclose(by_effect[name], by_file[name], atol=1e-9 * size, err_msg=effect)


def test_the_motor_never_speeds_up_faster_than_the_ramp():
    run, ramp = Run(command("step", {"final_rad": 0.5}), 0.15), 0.05
    speed = simulated(run, acceleration_limit=ramp)["motor_speed_rad_s"]
    rise = np.diff(speed)[5:] * run.sample_rate_Hz
    most = IDEAL.controller.speed_limit_rad_s / ramp
    assert np.quantile(rise, 0.98) == pytest.approx(most, rel=0.05)
    assert np.max(np.diff(simulated(run)["motor_speed_rad_s"])) * run.sample_rate_Hz > 2.0 * most


def test_a_dead_band_leaves_the_motor_short_of_its_target():
    band = 1e-3
    gap = STEP.command.at(np.array([0.1]))[0] - simulated(STEP, dead_band=band)["user_position_rad"][-1]
    assert gap == pytest.approx(band, rel=0.1)


def test_a_bias_in_the_current_loop_is_a_constant_load():
    """The motor lacks k_t b: motion and reading are those under a load of that torque."""
    bias = 0.3
    load = bias * IDEAL.motor.torque_constant_Nm_A / GEAR
    by_bias, by_load = simulated(CHIRP, current_sensor_bias=bias), simulated(CHIRP, constant_load=load)
    for name in SIGNALS:
        assert apart(by_bias, by_load, name) < 1e-6 * apart(by_bias, simulated(CHIRP), name), name


@pytest.mark.long
def test_a_bias_of_a_current_that_nothing_controls_is_seen_in_the_reading_alone():
    servo = replace(
        IDEAL,
        controller=replace(IDEAL.controller, kind="position", gain_1_rad=50.0, output_limit=1.0),
        inverter=Inverter("voltage", bus_voltage_V=48.0),
    )
    plain, seen = simulated(STEP, servo), simulated(STEP, servo, current_sensor_bias=0.3)
    for name in SIGNALS[1:]:
        np.testing.assert_array_equal(seen[name], plain[name])
    np.testing.assert_allclose(seen["current_A"][1:] - plain["current_A"][1:], 0.3, atol=1e-9)
    assert apart(simulated(STEP, servo, current_loop_lag=1e-3), plain) == 0.0
    assert apart(simulated(STEP, servo, sampled_control=5e-3), plain) > 0.0


# --- lanes ----------------------------------------------------------------------------------------------------------


def lanes(effects, count: int, actuator):
    stack = library_stack(actuator)
    steps, demand = 4000, STEP.command.at(np.arange(4000) * DT + 0.05)
    rows = monitor_rows(actuator, np.tile(HEALTHY, (count, 1)), stack, effects)
    result = np.empty((len(rows), steps // 20, 4, LANES))
    state = initial_state(actuator, len(rows), stack=stack)
    fixed = (demand, np.full(steps, 5.0), np.ones(steps), 20, 1, DT)
    stack.monitor.traces(state, rows, NOTHING, *fixed, result)
    return result.transpose(0, 3, 1, 2).reshape(-1, steps // 20, 4)[:count]


@pytest.mark.parametrize("integral_gain", [0.0, 5.0])
def test_each_lane_has_a_drive_of_its_own(integral_gain):
    """Beside others with other drives it is what it is alone; without an effect it is what it is without any."""
    actuator = IDEAL.with_values({"controller.integral_gain_Nm_rad": integral_gain})
    given = [(name, CATALOGUE[name].severities[2]) for name in IN_DRIVE]
    together: dict[str, dict[str, Any]] = {name: {**CATALOGUE[name].neutral} for name in IN_DRIVE}
    for lane, (name, value) in enumerate(given):
        first = CATALOGUE[name].parameters[0].name
        column = np.full(len(given) + 1, CATALOGUE[name].nothing)
        column[lane] = value
        together[name][first] = column
    found = lanes(together, len(given) + 1, actuator)
    for lane, (name, value) in enumerate(given):
        alone = lanes({name: {**CATALOGUE[name].neutral, CATALOGUE[name].parameters[0].name: value}}, 1, actuator)
        np.testing.assert_array_equal(found[lane], alone[0], err_msg=name)
    np.testing.assert_array_equal(found[-1], lanes({}, 1, actuator)[0])


# --- where they are -------------------------------------------------------------------------------------------------


def test_a_drive_that_is_not_simulated_has_no_effects():
    for name in DRIVE:
        effect = CATALOGUE[name]
        places = {place.__name__ for place in effect.places}
        assert idle(places, bool(effect.states), "unknown", "current"), name
        assert not idle(places, bool(effect.states), "cascade", "hysteresis"), name
    of = {name: {place.__name__ for place in CATALOGUE[name].places} for name in DRIVE}
    acting = {name for name in DRIVE if not idle(of[name], False, "position", "voltage")}
    assert acting == {"computation_delay", "dead_band", "goal_delay", "goal_gain", "goal_rate_limit", "sampled_control"}
