"""What recordings tell nothing of keeps its tolerance: families along which the equations do not change, measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest
from support.duty_bench import Bench
from support.duty_bench import logged as duty_logged

from ema_model.actuator import Actuator
from ema_model.actuator.file import parse_actuator
from ema_model.comparison import compare
from ema_model.comparison.result import Comparison
from ema_model.estimation.least_squares import known_together
from ema_model.recordings import Measurement

K, R, J = "motor.torque_constant_Nm_A", "motor.resistance_Ohm", "motor.inertia_kgm2"
B, C = "motor.viscous_friction_Nms_rad", "motor.dynamic_friction_Nm"
GAIN, MOMENT, READING = "controller.gain_1_rad", "effects.pendulum_load.moment_Nm", "sensors.current_gain"

MOTOR = """
[motor]
torque_constant_Nm_A = {{ value = {K}, tolerance = 0.3 }}
inertia_kgm2 = {{ value = {J}, tolerance = 0.3 }}
viscous_friction_Nms_rad = {{ value = {B}, tolerance = 0.5 }}
static_friction_Nm = {{ value = 0.0, free = false }}
dynamic_friction_Nm = {{ value = {C}, tolerance = 0.5 }}
"""
RESISTANCE = "resistance_Ohm = {{ value = {R}, tolerance = 0.3 }}\n"
ARM = """
[effects.pendulum_load]
moment_Nm = {{ value = {M}, tolerance = 0.2 }}
angle_rad = {{ value = 0.0, sigma = 0.02 }}
"""
SERVO = (
    '[model]\nstep_s = 5e-4\n[controller]\nkind = "position"\ngain_1_rad = {{ value = {G}, tolerance = 0.5 }}\n'
    '[inverter]\nkind = "voltage"\nbus_voltage_V = {{ value = {V}, tolerance = 0.1, free = {bus} }}\n'
    + MOTOR
    + RESISTANCE
    + ARM
)
UNKNOWN = (
    '[controller]\nkind = "unknown"\n' + MOTOR + ARM + "[sensors]\ncurrent_gain = {{ value = 1.0, sigma = 0.05 }}\n"
)
DUTY = '[controller]\nkind = "open"\n[inverter]\nkind = "voltage"\nbus_voltage_V = 12.0\n' + MOTOR + RESISTANCE
CURRENT = '[controller]\nkind = "open"\n' + MOTOR
TRUE = {"K": 0.37, "J": 5.5e-3, "B": 0.012, "C": 0.028, "R": 5.5, "M": 0.48, "G": 0.3, "V": 7.4}
OF_DUTY = {"K": 0.0105, "J": 1.6e-6, "B": 1.5e-6, "C": 1.1e-3, "R": 5.0}


def servo(seed: int, noise: float, amplitude: float = 0.5) -> Measurement:
    """A position servo with an arm, by hand: duty by the position error, no current logged."""
    v = TRUE
    step, every = 5e-4, 20
    time = np.arange(0.0, 4.0, step)
    goal = amplitude * np.sin(2.0 * np.pi * (0.3 * time + 0.25 * time**2)) + 0.2 * amplitude * np.sin(9.0 * time)
    place, speed, found = 0.0, 0.0, np.empty(len(time))
    for n, one in enumerate(goal):
        found[n] = place
        volts = v["V"] * np.clip(v["G"] * (one - place), -1.0, 1.0)
        pull = v["K"] * (volts - v["K"] * speed) / v["R"] - v["B"] * speed - v["M"] * np.sin(place)
        if speed == 0.0:
            pull = np.sign(pull) * max(0.0, abs(pull) - v["C"])
        else:
            pull -= v["C"] * np.sign(speed)
        after = speed + step * pull / v["J"]
        speed = 0.0 if after * speed < 0.0 else after
        place += step * speed
    error = noise * np.random.default_rng(seed).standard_normal(len(time[::every]))
    return Measurement(
        {"time_s": time[::every], "command_rad": goal[::every], "user_position_rad": found[::every] + error},
        name="servo",
    )


def moved(seed: int, noise: float) -> Measurement:
    """A motion that somebody drives, and the current that it takes."""
    time = np.arange(0.0, 4.0, 2e-3)
    rates, sizes = np.array([[2.1], [5.3], [11.0]]), np.array([[1.2], [0.5], [0.2]])
    place = np.sum(sizes * np.sin(rates * time), axis=0)
    speed, pull = (
        np.sum(sizes * rates * np.cos(rates * time), axis=0),
        -np.sum(sizes * rates**2 * np.sin(rates * time), axis=0),
    )
    v = TRUE
    torque = v["J"] * pull + v["B"] * speed + v["C"] * np.sign(speed) + v["M"] * np.sin(place)
    current = torque / v["K"] + noise * np.random.default_rng(seed).standard_normal(len(time))
    return Measurement(
        {"time_s": time, "motor_position_rad": place, "user_position_rad": place, "current_A": current}, name="moved"
    )


def duty(seed: int, noise: float) -> Measurement:
    return Measurement(duty_logged(Bench(), seed, noise, 500.0, 1.0), name="duty")


def driven(seed: int, noise: float) -> Measurement:
    """A current goes in, the speed is logged."""
    v, step, every = TRUE, 5e-4, 4
    time = np.arange(0.0, 3.0, step)
    current = 0.25 * np.sign(np.sin(3.0 * time)) + 0.1 * np.sin(17.0 * time)
    speed, found = 0.0, np.empty(len(time))
    for n, one in enumerate(current):
        found[n] = speed
        pull = v["K"] * one - v["B"] * speed
        pull = np.sign(pull) * max(0.0, abs(pull) - v["C"]) if speed == 0.0 else pull - v["C"] * np.sign(speed)
        after = speed + step * pull / v["J"]
        speed = 0.0 if after * speed < 0.0 else after
    error = noise * np.random.default_rng(seed).standard_normal(len(time[::every]))
    return Measurement(
        {"time_s": time[::every], "current_A": current[::every], "motor_speed_rad_s": found[::every] + error},
        name="driven",
    )


@dataclass(frozen=True, eq=False)
class Family:
    """Powers of one factor by which parameters change and no signal does; off: the file's values over the true ones."""

    file: str
    logged: Callable[[int, float], Measurement]
    noise: float
    powers: dict[str, float]
    off: dict[str, float]
    true: dict[str, float]
    free_bus: bool = False

    def actuator(self) -> Actuator:
        values = {name: self.off.get(name, 1.0) * value for name, value in self.true.items()}
        return parse_actuator(
            self.file.format(**{"M": 0.0, "G": 0.0, "V": 0.0, **values}, bus=str(self.free_bus).lower()), "bench.toml"
        )

    @lru_cache(maxsize=2)  # noqa: B019 — two tests ask for the same one
    def compared(self, seed: int) -> Comparison:
        """One of its recordings with the file's model."""
        return compare([self.logged(seed, self.noise)], self.actuator())

    def left(self, seed: int) -> tuple[float, dict[str, bool]]:
        """How much of its prior's σ the family's direction keeps, and whether each interval holds the truth."""
        actuator, found = self.actuator(), self.compared(seed).calibration
        assert found is not None
        names = [*found.parameters]
        jacobian = found.weighted_jacobian
        covariance = np.linalg.inv(jacobian.T @ jacobian / found.covariance_scale + np.eye(jacobian.shape[1]))
        along = np.zeros(len(covariance))
        for name, power in self.powers.items():
            along[names.index(name)] = power * found.parameters[name].value / actuator.tolerances[name].sigma
        along /= np.linalg.norm(along)
        letters = {K: "K", R: "R", J: "J", B: "B", C: "C", GAIN: "G", MOMENT: "M"}
        holds = {
            name: one.interval90[0] <= self.true[letters[name]] <= one.interval90[1]
            for name, one in found.parameters.items()
            if name in letters
        }
        return float(np.sqrt(along @ covariance @ along)), holds


FAMILIES = {
    "servo, strength": Family(SERVO, servo, 3e-4, {GAIN: 1, K: 1, R: 2}, {"G": 1.3, "R": 0.9}, TRUE),
    "servo, weight": Family(SERVO, servo, 3e-4, {MOMENT: 1, J: 1, B: 1, C: 1, R: -1}, {"M": 1.05, "J": 0.9}, TRUE),
    "servo, supply": Family(SERVO, servo, 3e-4, {GAIN: 1, "inverter.bus_voltage_V": -1}, {"V": 1.05}, TRUE, True),
    "servo, small moves": Family(
        SERVO, lambda seed, noise: servo(seed, noise, 0.2), 3e-4, {GAIN: 1, K: 1, R: 2}, {"K": 1.1}, TRUE
    ),
    "motion, all torques": Family(
        UNKNOWN, moved, 0.02, {K: 1, J: 1, B: 1, C: 1, MOMENT: 1}, {"K": 1.1, "J": 0.9}, TRUE
    ),
    "motion, a reading's gain": Family(UNKNOWN, moved, 0.02, {K: 1, READING: 1}, {"K": 0.92, "B": 1.2}, TRUE),
    "motion, slow": Family(UNKNOWN, moved, 0.1, {K: 1, J: 1, B: 1, C: 1, MOMENT: 1}, {"C": 1.3, "M": 0.95}, TRUE),
    "duty, resistance": Family(DUTY, duty, 2.0, {R: 1, J: -1, B: -1, C: -1}, {"R": 1.1, "J": 1.1}, OF_DUTY),
    "duty, noisy": Family(DUTY, duty, 8.0, {R: 1, J: -1, B: -1, C: -1}, {"K": 1.1, "C": 0.9}, OF_DUTY),
    "current in": Family(CURRENT, driven, 0.1, {K: 1, J: 1, B: 1, C: 1}, {"K": 1.1, "J": 0.9}, TRUE),
}
QUICK = ("servo, strength", "motion, all torques")


@pytest.mark.parametrize(
    "name", [one if one in QUICK else pytest.param(one, marks=pytest.mark.long) for one in FAMILIES]
)
def test_a_family_that_no_signal_shows_keeps_its_tolerance(name):
    left, holds = FAMILIES[name].left(1)
    print(name, left, holds)
    assert left > 0.9 and all(holds.values())


def test_where_a_voltage_limit_breaks_the_family_it_may_be_told():
    """At its greatest duty the servo's torque is the supply's over the resistance, whatever the gain."""
    wide = Family(SERVO, lambda seed, noise: servo(seed, noise, 6.0), 3e-4, {GAIN: 1, K: 1, R: 2}, {"G": 1.3}, TRUE)
    assert wide.left(1)[0] < 0.5


def test_what_is_known_only_together_is_said():
    result = FAMILIES["servo, strength"].compared(1)
    document = result.to_dict()
    product = next(one for one in document["identifiable"] if one["members"] == {GAIN: 1, K: 1, R: -1, MOMENT: -1})
    said = "controller gain · motor torque constant / (motor resistance · pendulum load: moment)"
    assert product["combination"] == said
    low, high = product["interval90"]
    assert low < TRUE["G"] * TRUE["K"] / (TRUE["R"] * TRUE["M"]) < high
    assert "Known only together, if the model is right: " in str(result) and "Record the current as well" in str(result)


def test_products_are_found_by_their_powers():
    """a·b/c known to 1 %, a and b/c not at all; what follows from it is not said again."""
    tell = np.array([[1.0, 1.0, -1.0, 0.0]]) / 0.01
    covariance = np.linalg.inv(tell.T @ tell + np.diag([25.0, 25.0, 25.0, 1e4]))
    (one,) = known_together("abcd", np.ones(4), np.ones(4), covariance)
    assert one.powers == {"a": 1, "b": 1, "c": -1} and one.relative == pytest.approx(0.01, rel=0.05)
    assert not known_together("abcd", np.ones(4), np.ones(4), np.diag([0.04, 0.04, 0.04, 1e-4]))


@pytest.mark.study
@pytest.mark.parametrize("name", FAMILIES)
def test_intervals_along_families_hold(name):
    """Ten families, 50 draws of noise: `pytest -m study -s tests/estimation/test_information.py`."""
    seen = [FAMILIES[name].left(seed) for seed in range(50)]
    held = {one: sum(holds[one] for _, holds in seen) for one in seen[0][1]}
    print(f"{name}: least of the prior's σ left {min(left for left, _ in seen):.3f}; true values held of 50: {held}")
    assert all(left > 0.9 for left, _ in seen) and all(count >= 45 for count in held.values())
