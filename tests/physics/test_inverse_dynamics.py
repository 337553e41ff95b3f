"""Inverse dynamics: the current of a motion, found again from the motion alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from ema_model.actuator import Actuator, load_actuator
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError
from ema_model.models import InverseDynamics
from ema_model.models.measured_motion import motion_of
from ema_model.physics.rows import LANES
from ema_model.recordings import Measurement, SideFile
from ema_model.simulation.pack import monitor_rows, stack_at_hand, wait_for

FREE = """
name = "free motor"
[controller]
kind = "unknown"
[motor]
torque_constant_Nm_A = 0.05
inertia_kgm2 = { value = 1e-4, tolerance = 0.3 }
viscous_friction_Nms_rad = { value = 2e-5, sigma = 2e-5 }
static_friction_Nm = 0.0
dynamic_friction_Nm = { value = 0.01, sigma = 0.01 }
"""


def motor(tmp_path, extra: str = "") -> Actuator:
    path = tmp_path / "free.toml"
    path.write_text(FREE + extra, encoding="utf-8")
    return load_actuator(path)


def spin(cogging: float = 0.0, order: int = 7, duration: float = 2.0) -> Measurement:
    """A known motion, and the current that the equations give for it."""
    time = np.arange(0.0, duration, 5e-4)
    angle = 30.0 * time + 8.0 * np.sin(2.0 * np.pi * 1.5 * time)
    speed = 30.0 + 8.0 * 2.0 * np.pi * 1.5 * np.cos(2.0 * np.pi * 1.5 * time)
    acceleration = -8.0 * (2.0 * np.pi * 1.5) ** 2 * np.sin(2.0 * np.pi * 1.5 * time)
    torque = 1e-4 * acceleration + 2e-5 * speed + 0.01 * np.sign(speed) - cogging * np.sin(order * angle)
    return Measurement({"time_s": time, "motor_position_rad": angle, "current_A": torque / 0.05}, name="spin")


def error(plant: InverseDynamics) -> float:
    [window] = plant.windows
    needed = plant.signals(0)["current_A"][0]
    inner = slice(10, -10)  # the ends are continued, not known
    return float(np.sqrt(np.mean((needed - window.measured["current_A"])[inner] ** 2)))


def test_current_of_a_known_motion(tmp_path):
    plant = InverseDynamics([spin()], motor(tmp_path))
    assert error(plant) < 2e-3 * np.sqrt(np.mean(spin()["current_A"] ** 2))


# Strength, friction by the motor's torque and by what is carried on, the motor's torque by its current.
LAWS = {
    "load_dependent_friction": (0.4, lambda torque, carried: 0.01 + 0.4 * abs(torque), lambda current: 0.05 * current),
    "mesh_friction": (0.6, lambda torque, carried: 0.01 + 0.6 * abs(carried), lambda current: 0.05 * current),
    "torque_saturation": (
        0.1,
        lambda torque, carried: 0.01,
        lambda current: 0.05 * current / (1.0 + 0.1 * abs(current)),
    ),
}


@pytest.mark.parametrize("effect", LAWS)
def test_the_current_is_found_that_friction_or_torque_depend_on_itself(tmp_path, effect):
    """Driving and braking, both ways, beside the root of the one equation that it must solve."""
    strength, friction, torque_of = LAWS[effect]
    actuator = motor(tmp_path)
    effects = {effect: {CATALOGUE[effect].parameters[0].name: strength}}
    stack = stack_at_hand(actuator, effects, "reduced", "currents")
    rows = monitor_rows(actuator, actuator.k[None], stack, effects)
    wait_for(stack, "currents")
    speed, acceleration = (each.ravel() for each in np.meshgrid([-80.0, 40.0], np.linspace(-700.0, 700.0, 29)))
    nothing = np.zeros_like(speed)
    found = np.empty((len(rows), len(speed), LANES))
    stack.inverse.currents(rows, nothing, speed, acceleration, nothing, nothing, 1e-9, found)
    for one, omega, alpha in zip(found[0, :, 0], speed, acceleration):

        def lacks(current: float, omega: float = omega, carried: float = 1e-4 * alpha) -> float:
            torque = torque_of(current)
            return carried + 2e-5 * omega + np.sign(omega) * friction(torque, carried) - torque

        assert one == pytest.approx(brentq(lacks, -50.0, 50.0, xtol=1e-12), abs=1e-4)


def test_cogging_is_seen_and_taken_off_by_the_effect(tmp_path):
    # Seven periods a turn at 30 … 100 rad/s are up to 110 Hz, beyond the filter: both sides must pass it alike.
    without = error(InverseDynamics([spin(0.004)], motor(tmp_path)))
    effect = {"cogging_torque": {"amplitude_Nm": 0.004, "order": 7.0, "phase_rad": 0.0}}
    assert without > 0.008
    assert error(InverseDynamics([spin(0.004)], motor(tmp_path), effects=effect)) < 0.06 * without


def test_filter_of_the_motion_is_exact():
    time = np.arange(4000) * 1e-3
    for frequency in (1.0, 10.0, 40.0):
        pulsation = 2.0 * np.pi * frequency
        motion = motion_of(np.sin(pulsation * time), 1e-3, 12e-3)
        assert motion.kernel.sum() == pytest.approx(1.0)
        expected = -(pulsation**2) * motion.filtered(np.sin(pulsation * time))
        inner = slice(100, -100)
        scale = np.abs(expected[inner]).max() + 1e-12
        # the second difference itself is short by (ω dt)²/12
        assert np.abs(motion.acceleration - expected)[inner].max() < ((pulsation * 1e-3) ** 2 / 10.0 + 1e-6) * scale
        line = motion_of(3.0 * time + 1.0, 1e-3, 12e-3)
        np.testing.assert_allclose(line.speed, 3.0, rtol=1e-9)
        np.testing.assert_allclose(line.acceleration, 0.0, atol=1e-6)


def test_standstill_is_left_out(tmp_path):
    moving = spin()
    time = np.arange(0.0, 2.0, 5e-4)
    stuck = np.full_like(time, moving["motor_position_rad"][-1])
    both = Measurement(
        {
            "time_s": np.concatenate([moving.time_s, 2.0 + time]),
            "motor_position_rad": np.concatenate([moving["motor_position_rad"], stuck]),
            "current_A": np.concatenate([moving["current_A"], np.full_like(time, 0.15)]),
        }
    )
    [window] = InverseDynamics([both], motor(tmp_path)).windows
    assert window.time_s.max() < 2.05


def test_population_is_single_runs(tmp_path):
    actuator = motor(tmp_path)
    plant = InverseDynamics([spin()], actuator)
    inertias = np.linspace(5e-5, 2e-4, 37)
    k = np.tile([0, 0, 0, 0, 0, 0, 0.5, 0.5], (37, 1))
    together = plant.signals(0, actuator.varied({"motor.inertia_kgm2": inertias}), k)["current_A"]
    for i in (0, 31, 32, 36):
        alone = plant.signals(0, actuator.with_values({"motor.inertia_kgm2": inertias[i]}))["current_A"][0]
        np.testing.assert_array_equal(together[i], alone)


def test_static_map_needs_no_time_and_shows_the_shaft(tmp_path):
    angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    held = Measurement(
        {"time_s": np.arange(400.0), "motor_position_rad": angle, "current_A": 0.08 * np.sin(7.0 * angle)},
        side=SideFile(kind="map"),
    )
    actuator = motor(
        tmp_path, "[effects.cogging_torque]\namplitude_Nm = 0.004\norder = 7\nphase_rad = 3.141592653589793\n"
    )
    plant = InverseDynamics([held], actuator)
    [window] = plant.windows
    np.testing.assert_allclose(plant.signals(0)["current_A"][0], window.measured["current_A"], atol=1e-5)
    assert window.blocks == 400


def test_without_current_or_motion_there_is_nothing_to_compare(tmp_path):
    bare = Measurement({"time_s": np.arange(500) * 1e-3, "motor_position_rad": np.arange(500) * 0.01}, name="bare")
    with pytest.raises(InputError, match="bare: nothing to compare; current_A or motor_torque_Nm"):
        InverseDynamics([bare], motor(tmp_path))
    still = bare.with_signals(motor_position_rad=np.zeros(500), current_A=np.ones(500))
    with pytest.raises(InputError, match="too little motion"):
        InverseDynamics([still], motor(tmp_path))


def test_a_command_exceeds_its_current_by_an_apparent_inertia(tmp_path):
    """The command that a current loop k_p = L ω_c, k_i = R ω_c needs for a known motion's current, step by step."""
    resistance, inductance, bandwidth, constant = 0.3, 1.5e-4, 3000.0, 0.05
    motion, step = spin(), 5e-6
    time = np.arange(0.0, motion.time_s[-1], step)
    turning = 30.0 + 8.0 * 2.0 * np.pi * 1.5 * np.cos(2.0 * np.pi * 1.5 * time)
    current = np.interp(time, motion.time_s, motion["current_A"])
    voltage = resistance * current + inductance * np.gradient(current, step) + constant * turning
    asked, integral = np.empty_like(voltage), voltage[0] / (resistance * bandwidth)
    for i, needed in enumerate(voltage):
        more = (needed - resistance * bandwidth * integral) / (inductance * bandwidth)
        asked[i], integral = current[i] + more, integral + step * more
    command = motion.with_signals(current_A=np.interp(motion.time_s, time, asked))
    share = constant**2 / (resistance * bandwidth * 1e-4)
    ahead = f"[sensors]\ndelay_s = {-1.0 / bandwidth}\n"  # the loop's own lag
    left = [
        error(InverseDynamics([command], motor(tmp_path, f"{ahead}apparent_inertia = {one}\n"))) for one in (0.0, share)
    ]
    assert share > 0.02 and left[1] < 0.05 * left[0]


def test_a_ripple_of_the_torque_passes_the_filter_while_the_motor_speeds_up(tmp_path):
    """I = T / {k_t [1 + a cos(h θ + φ)]}: faster than the filter, it is as little in the model as in the current."""
    plain, ripple = spin(), {"torque_ripple": {"ratio": 0.1, "order": 13.0, "phase_rad": 0.4}}
    waves = 1.0 + 0.1 * np.cos(13.0 * plain["motor_position_rad"] + 0.4)
    plant = InverseDynamics([plain.with_signals(current_A=plain["current_A"] / waves)], motor(tmp_path), effects=ripple)
    assert error(plant) < 3e-3 * np.sqrt(np.mean(plain["current_A"] ** 2))
