"""A population's lanes against single runs, bit for bit, and recordings against each other."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from support.representative import first_of

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.effects import find
from ema_model.faults import HEALTHY, vector
from ema_model.identification.search import Objective
from ema_model.physics.rows import LANES
from ema_model.recordings import Measurement
from ema_model.simulation import run as simulation
from ema_model.simulation.pack import initial_state, monitor_rows, stack_at_hand
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import Run, simulate_monitor, traced
from ema_model.stacks import CIRCUITS, exclusive, find_stack

ACTUATOR = load_actuator()
RUN = Run(command("chirp"), 0.1, load_torque_Nm=5.0)
STACKS = [
    {},
    {"cogging_torque": {"amplitude_Nm": 0.02}, "stribeck_friction": {"speed_rad_s": 12.0}},
    {"cogging_torque": {"amplitude_Nm": 0.02, "order": 7.0, "phase_rad": 0.4}},
]
each_circuit = pytest.mark.parametrize("circuit", first_of(sorted(CIRCUITS)))
each_stack = pytest.mark.parametrize("effects", first_of(STACKS), ids=["none", "two effects", "cogging"])


def population(n: int, seed: int = 0):
    return np.random.default_rng(seed).random((n, 8))


@pytest.fixture(scope="module")
def recording() -> Measurement:
    return simulated(Run(command("chirp"), 0.1), ACTUATOR, vector({"k1": 0.3, "k3": 0.2}))


@each_circuit
@each_stack
def test_fitness_does_not_depend_on_the_neighbours(recording, circuit, effects):
    objective = Objective([recording], ACTUATOR, effects=effects, circuit=circuit)
    k = population(LANES + 8, seed=1)
    together = objective(k)
    assert np.all(np.isfinite(together)) and len(set(together)) == len(k)
    np.testing.assert_array_equal(together, [objective(one)[0] for one in k])
    order = np.random.default_rng(2).permutation(len(k))
    np.testing.assert_array_equal(objective(k[order]), together[order])
    # and it is the root mean square of what `currents` gives
    rms = np.sqrt(np.mean((objective.currents(k) - objective.target) ** 2, axis=1))
    np.testing.assert_allclose(together, rms, rtol=1e-9)


@each_circuit
@each_stack
def test_traces_of_a_population_are_single_runs(monkeypatch, circuit, effects):
    """A single run's own call of its kernel, repeated with a population in place of the one.

    The objectives above have compiled these stacks; the library's lanes are in test_one_stack.
    """
    n = LANES + 5  # a block and a part of one
    k = population(n)
    settings = {name: find(name).settings(dict(given)) for name, given in effects.items()}
    stack = stack_at_hand(ACTUATOR, settings, circuit, "traces")
    rows = monitor_rows(ACTUATOR, k, stack, settings)
    assert len(rows) == 2
    calls = []

    def spy(stack, state, own_rows, *same):
        assert len(own_rows) == 1, "a single run is one block"
        calls.append(same)
        return traced(stack, state, own_rows, *same)

    monkeypatch.setattr(simulation, "traced", spy)
    simulate_monitor(RUN, ACTUATOR, k[0], effects, circuit)
    [same] = calls
    result = traced(stack, initial_state(ACTUATOR, len(rows), stack=stack), rows, *same)
    columns = ("current_A", "motor_speed_rad_s", "motor_position_rad")
    for i in (0, 1, LANES - 1, LANES, n - 1):
        single = simulate_monitor(RUN, ACTUATOR, k[i], effects, circuit)
        for column, name in enumerate(columns):
            lane = result[i // LANES, :, column, i % LANES]
            np.testing.assert_array_equal(lane, single[name][1:], err_msg=f"{name}, individual {i}")
    ends = {result[i // LANES, -1, 2, i % LANES] for i in range(n)}
    assert len(ends) >= n - 2, "individuals must differ, but for those whose friction holds them"


def test_effects_parameters_may_differ_by_lane():
    speeds = np.array([3.0, 10.0, 25.0])
    stack = find_stack("reduced", ["stribeck_friction"])
    k = np.tile(HEALTHY, (3, 1))
    rows = monitor_rows(ACTUATOR, k, stack, {"stribeck_friction": {"speed_rad_s": speeds}})
    row = stack.parameter_rows.index("stribeck_friction.speed_rad_s")
    np.testing.assert_array_equal(rows[0, row * LANES : row * LANES + 3], speeds)
    assert np.all(rows[0, row * LANES + 3 : (row + 1) * LANES] == 25.0)
    for i, speed in enumerate(speeds):
        alone = monitor_rows(ACTUATOR, HEALTHY, stack, {"stribeck_friction": {"speed_rad_s": speed}})
        np.testing.assert_array_equal(rows[0].reshape(-1, LANES)[:, i], alone[0].reshape(-1, LANES)[:, 0])


@each_circuit
def test_gains_may_differ_by_lane(recording, circuit):
    """A speed loop that remembers nothing stands beside those that do, and each is a single run, bit for bit."""
    gains = {
        "controller.integral_gain_Nm_rad": np.array([0.0, 3.0, 0.0, 8.0]),
        "controller.derivative_gain_Nms2_rad": np.array([0.0, 0.0, 1e-7, 2e-7]),
    }
    k = population(4, seed=6)
    objective = Objective([recording], ACTUATOR, circuit=circuit)
    together = objective.currents(k, ACTUATOR.varied(gains))
    assert len({float(current[-1]) for current in together}) == 4
    for i in range(4):
        one = ACTUATOR.with_values({path: values[i] for path, values in gains.items()})
        np.testing.assert_array_equal(together[i], objective.currents(k[i], one)[0])
        alone = Objective([recording], one, circuit=circuit)
        rms = np.sqrt(np.mean((together[i] - objective.target) ** 2))
        assert alone(k[i])[0] == pytest.approx(rms, rel=1e-9)
    np.testing.assert_array_equal(together[0], objective.currents(k[0])[0])


def test_recordings_add_up_as_a_quadrature():
    truth = vector({"k1": 0.4})
    parts = [
        simulated(Run(command("chirp"), 0.1), ACTUATOR, truth),
        simulated(Run(command("sine", {"frequency_Hz": 8.0}), 0.2, load_torque_Nm=8.0), ACTUATOR, truth),
        # another sampling: its blocks cannot share a kernel call with the others'
        simulated(Run(command("step", {"final_rad": 4e-3}), 0.15), ACTUATOR, truth).resampled(2.5e-4),
    ]
    objectives = [Objective([part], ACTUATOR) for part in parts]
    assert len({o.windows[0].steps_per_block for o in objectives} | {o.blocks for o in objectives}) > 2
    k = population(9, seed=3)
    together = Objective(parts, ACTUATOR)
    assert together.blocks == sum(o.blocks for o in objectives)
    squares = sum(o.blocks * o(k) ** 2 for o in objectives)
    np.testing.assert_allclose(together(k), np.sqrt(squares / together.blocks), rtol=1e-12)
    np.testing.assert_array_equal(together.currents(k), np.concatenate([o.currents(k) for o in objectives], axis=1))
    # the order of the recordings does not matter
    np.testing.assert_allclose(Objective(parts[::-1], ACTUATOR)(k), together(k), rtol=1e-12)


@each_circuit
@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf, 1e300])
@pytest.mark.parametrize("component", [0, 2, 5, 7])
def test_a_broken_lane_leaves_the_others_alone(recording, circuit, broken, component):
    objective = Objective([recording], ACTUATOR, circuit=circuit)
    k = population(20, seed=4)
    clean = objective(k)
    ill = k.copy()
    ill[7, component] = broken
    fitness = objective(ill)
    others = np.arange(20) != 7
    np.testing.assert_array_equal(fitness[others], clean[others])
    assert not np.isnan(fitness).any()


def test_divergence_stays_in_its_lane(recording):
    """With so small an inductance the explicit step of the thesis's circuit is unstable."""
    unstable = ACTUATOR.with_values({"motor.inductance_H": 5e-7})
    assert np.all(Objective([recording], unstable, circuit="thesis")(population(3)) == np.inf)
    objective = Objective([recording], ACTUATOR, circuit="thesis")
    k = population(12, seed=5)
    clean = objective.currents(k)
    inductance = np.full(12, ACTUATOR.motor.inductance_H)
    inductance[4] = 5e-7
    one_ill = replace(ACTUATOR, motor=replace(ACTUATOR.motor, inductance_H=inductance))
    currents = objective.currents(k, one_ill)
    others = np.arange(12) != 4
    np.testing.assert_array_equal(currents[others], clean[others])
    assert not np.all(np.isfinite(currents[4]))


def test_divergence_is_told_of_a_single_run():
    unstable = ACTUATOR.with_values({"motor.inductance_H": 5e-7})
    with pytest.raises(FloatingPointError, match=r"the monitor model diverged: .* is not finite from .* s on"):
        simulate_monitor(RUN, unstable, circuit="thesis")


@pytest.mark.parametrize(
    ("circuit", "component"),
    [
        ("thesis", 2),
        ("thesis", 5),
        ("reduced", 7),
        ("thesis", 0),
        ("reduced", 0),
        ("reduced", 2),
        ("reduced", 5),
        ("thesis", 7),
    ],
)
def test_what_is_not_a_number_is_no_answer(recording, circuit, component):
    k = HEALTHY.copy()
    k[component] = np.nan
    assert Objective([recording], ACTUATOR, circuit=circuit)(k)[0] == np.inf


def test_no_thread_is_kept_waiting_that_has_nothing_to_do():
    seen, threads = [], numba.get_num_threads()
    for jobs in (1, threads, threads + 1, None):
        exclusive(lambda: seen.append(numba.get_num_threads()), jobs=jobs)
    assert seen == [1, threads, threads, threads]
    with pytest.raises(ZeroDivisionError):
        exclusive(lambda: 1 / 0, jobs=1)
    assert numba.get_num_threads() == threads, "also after a kernel that failed"
