"""The healthy Reference and Monitor Models against each other and against the laws they are made of."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import Recorded, command
from ema_model.simulation.plant import SHOWN, simulate_references
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference
from ema_model.stacks import CIRCUITS

ACTUATOR = load_actuator()
CHIRP = Run(command("chirp"))
STEP = Run(command("step"), duration_s=0.25)  # 1 rad: saturates speed, current and voltage

each_circuit = pytest.mark.parametrize("circuit", CIRCUITS)


@pytest.fixture(scope="module")
def reference():
    return simulate_reference(CHIRP, ACTUATOR)


def blocks(run, name="current_A", samples=5):
    """Means over 0.5 ms."""
    values = run[name][1:]
    return values[: len(values) // samples * samples].reshape(-1, samples).mean(axis=1)


@each_circuit
def test_monitor_follows_reference(reference, circuit):
    monitor = simulate_monitor(CHIRP, ACTUATOR, circuit=circuit)
    assert np.ptp(reference["motor_position_rad"]) > 4.0, "the run must move for the comparison to mean something"
    for name, limit in (("motor_position_rad", 2e-3), ("user_position_rad", 5e-6)):
        assert np.max(np.abs(monitor[name] - reference[name])) <= limit
    assert np.sqrt(np.mean((blocks(monitor) - blocks(reference)) ** 2)) <= 0.05
    np.testing.assert_array_equal(monitor["command_rad"], reference["command_rad"])


def test_models_differ_by_what_the_monitor_leaves_out(reference):
    """They are two models: a Monitor Model that copied the reference would pass the test above."""
    monitor = simulate_monitor(CHIRP, ACTUATOR)
    assert np.sqrt(np.mean((blocks(monitor) - blocks(reference)) ** 2)) > 0.005


def imbalance(emf_scale: float, load: float) -> float:
    """(Energy taken from the legs − energy accounted for) / energy taken, over a short acceleration."""
    actuator = ACTUATOR.with_values({"motor.emf_scale": emf_scale})
    rate = 1e6
    run = Run(command("step", {"final_rad": 0.05, "time_s": 1e-3}), 0.02, rate, load)
    s = simulate_reference(run, actuator, voltages=True)
    dt = 1.0 / rate
    currents = np.stack([s[f"phase_{x}_current_A"] for x in "abc"])
    voltages = np.stack([s[f"leg_{x}_voltage_V"] for x in "abc"])[:, 1:]
    middle = 0.5 * (currents[:, 1:] + currents[:, :-1])
    speed, angle = s["motor_speed_rad_s"], s["motor_position_rad"]
    motor, transmission = actuator.motor, actuator.transmission
    mean_speed = np.diff(angle) / dt
    taken = np.sum(voltages * middle) * dt
    accounted = {
        "copper": 0.5 * motor.resistance_Ohm * np.sum(middle**2) * dt,
        "magnetic": 0.5 * (0.5 * motor.inductance_H) * np.sum(currents[:, -1] ** 2 - currents[:, 0] ** 2),
        "kinetic": 0.5 * motor.inertia_kgm2 * (speed[-1] ** 2 - speed[0] ** 2),
        "friction": motor.dynamic_friction_Nm * np.sum(np.abs(np.diff(angle))),
        "viscous": (motor.viscous_friction_Nms_rad + transmission.viscous_friction_Nms_rad)
        * np.sum(mean_speed**2)
        * dt,
        "load": transmission.gear_ratio * load * (angle[-1] - angle[0]),
    }
    assert angle[-1] > 5.0 and accounted["kinetic"] > 0.3 * taken, "the run must accelerate"
    return (taken - sum(accounted.values())) / taken


@pytest.mark.parametrize("load", [0.0, 20.0])
def test_energy_balance_closes_at_emf_scale_two(load):
    assert abs(imbalance(2.0, load)) <= 0.01


def test_energy_balance_is_open_at_the_thesis_scale():
    """The default's surplus is the thesis's: torque 2K against a smaller EMF."""
    assert imbalance(np.sqrt(2.0), 0.0) < -0.05


def test_top_speeds():
    reference = simulate_reference(STEP, ACTUATOR)
    thesis = simulate_monitor(STEP, ACTUATOR, circuit="thesis")
    assert np.max(reference["motor_speed_rad_s"]) == pytest.approx(574.0, rel=0.03)
    assert np.max(thesis["motor_speed_rad_s"]) == pytest.approx(617.0, rel=0.03)
    reduced = simulate_monitor(STEP, ACTUATOR, circuit="reduced")
    assert np.max(reduced["motor_speed_rad_s"]) == pytest.approx(np.max(reference["motor_speed_rad_s"]), rel=0.03)


@pytest.mark.parametrize("k", [{}, {"k3": 0.6, "k5": 0.2, "k6": 0.3}])
def test_phase_currents_sum_to_zero(k):
    from ema_model.faults import vector

    s = simulate_reference(CHIRP, ACTUATOR, vector(k))
    phases = np.stack([s[f"phase_{x}_current_A"] for x in "abc"])
    assert np.max(np.abs(phases)) > 1.0
    assert np.max(np.abs(phases.sum(axis=0))) < 1e-9


def test_equivalent_current_gives_the_torque(reference):
    """T_m = 0.0752 · I_3eq for a healthy motor."""
    torque, current = reference["motor_torque_Nm"], reference["current_A"]
    assert np.max(np.abs(torque)) > 0.2
    np.testing.assert_allclose(torque, ACTUATOR.motor.torque_constant_Nm_A * current, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("model", ["reference", *CIRCUITS])
@pytest.mark.parametrize("name", ["chirp", "step"])
def test_command_negated_negates_the_signals(model, name):
    size = {"chirp": ("amplitude_rad", 5e-3), "step": ("final_rad", 1e-2)}[name]

    def simulated(sign):
        run = Run(command(name, {size[0]: sign * size[1]}), duration_s=0.2)
        return (
            simulate_reference(run, ACTUATOR)
            if model == "reference"
            else simulate_monitor(run, ACTUATOR, circuit=model)
        )

    up, down = simulated(1.0), simulated(-1.0)
    for signal in ("command_rad", "user_position_rad", "motor_position_rad", "motor_speed_rad_s", "current_A"):
        scale = np.max(np.abs(up[signal]))
        assert scale > 0.0
        # The legs' relays start at +1 for both signs, so a step of the reference model may differ by the ripple.
        tolerance = 1e-9 if (model, name) != ("reference", "step") else 2e-2
        assert np.max(np.abs(up[signal] + down[signal])) <= tolerance * scale, signal


def test_first_sample_is_the_start_at_rest(reference):
    for run in (reference, simulate_monitor(CHIRP, ACTUATOR)):
        assert run["time_s"][0] == 0.0 and run["current_A"][0] == 0.0 and run["motor_speed_rad_s"][0] == 0.0
    started = simulate_monitor(CHIRP, ACTUATOR, start_rad=2e-3)
    assert started["user_position_rad"][0] == pytest.approx(2e-3)
    assert started["motor_position_rad"][0] == pytest.approx(2e-3 / ACTUATOR.transmission.gear_ratio)


def test_current_sample_is_the_mean_over_its_period():
    """The same run sampled ten times as often: groups of ten average to the slow run's samples."""
    slow = simulate_reference(Run(sample_rate_Hz=10_000.0, duration_s=0.1), ACTUATOR)
    fast = simulate_reference(Run(sample_rate_Hz=100_000.0, duration_s=0.1), ACTUATOR)
    np.testing.assert_allclose(slow["current_A"][1:], fast["current_A"][1:].reshape(-1, 10).mean(axis=1), atol=1e-9)
    np.testing.assert_allclose(slow["motor_position_rad"], fast["motor_position_rad"][::10], atol=1e-12)


# --- several runs of the Reference Model at once are those of one after the other, to the last bit --------------------

SAMPLES, RATE_HZ = 400, 10_000.0
TIME = np.arange(SAMPLES * 10) * 1e-5
COMMAND = Recorded(TIME, 0.01 * np.sin(2.0 * np.pi * 40.0 * TIME))
STILL = dict.fromkeys(("load_Nm", "start_rad", "start_speed_rad_s", "start_play_rad", "start_integral_Nm"), 0.0)


@pytest.mark.parametrize("integral", [0.0, 2.0], ids=["plain", "with an integral action"])
def test_each_lane_is_a_run_of_its_own(integral):
    actuator = ACTUATOR.varied({"controller.integral_gain_Nm_rad": integral})
    k = 0.5 * np.random.default_rng(3).random((3, 8))
    friction, load, turned = (np.array(one) for one in ([0.004, 0.006, 0.008], [0.0, 5.0, -5.0], [0.0, 1e-4, 2e-4]))
    start = {"start_speed_rad_s": 2.0, "start_play_rad": 1e-3, "start_integral_Nm": 0.0}
    varied = actuator.varied({"motor.dynamic_friction_Nm": friction})
    together = simulate_references(COMMAND, SAMPLES, RATE_HZ, varied, k, {}, load_Nm=load, start_rad=turned, **start)
    for i in range(len(k)):
        one = simulate_reference(
            Run(COMMAND, SAMPLES / RATE_HZ, RATE_HZ, load_torque_Nm=load[i]),
            actuator.varied({"motor.dynamic_friction_Nm": friction[i]}),
            k[i],
            start_rad=turned[i],
            **start,
        )
        for name in SHOWN:
            assert np.array_equal(together[name][i], one[name][1:]), name
            assert np.ptp(one[name]) > 0.0


def test_too_many_are_refused():
    with pytest.raises(ValueError, match="33 runs at once; 16 are the most"):
        simulate_references(COMMAND, SAMPLES, RATE_HZ, ACTUATOR, np.zeros((33, 8)), {}, **STILL)


def test_one_that_diverges_is_told():
    with pytest.raises(FloatingPointError, match="diverged"):
        actuator = ACTUATOR.varied({"motor.inductance_H": np.array([1e-9, 1e-9])})
        simulate_references(COMMAND, SAMPLES, RATE_HZ, actuator, np.zeros((2, 8)), {}, **STILL)
