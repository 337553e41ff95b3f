"""The library in one stack: what is not asked for does nothing, and a model's own stack gives the same signals."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping

import numpy as np
import pytest
from support.compiled import compiled

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.effects import CATALOGUE, find
from ema_model.effects.effect import ADVANCE, PLACES, STAGES
from ema_model.effects.user import user_torque
from ema_model.faults import HEALTHY
from ema_model.identification.search import Objective
from ema_model.models import ClosedLoop, InverseDynamics
from ema_model.physics.rows import LANES
from ema_model.simulation import pack as compiled_simulation
from ema_model.simulation.pack import (
    LIBRARY,
    initial_reference_state,
    initial_state,
    is_compiled,
    library_stack,
    monitor_rows,
    own_stack,
    reference_rows,
    stack_at_hand,
)
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import NOTHING, Run
from ema_model.stacks import Stack

ACTUATOR = load_actuator()
GEAR = ACTUATOR.transmission.gear_ratio
STEP_S, STEPS, PER_VALUE = 1e-5, 20_000, 50
COMMANDS = {"chirp": command("chirp"), "step": command("step"), "small step": command("step", {"final_rad": 5e-3})}
LOAD_NM = 20.0
_ROUNDING = 1e-10  # of a signal's size; where a shaft swings, rounding has grown to 1.5e-12 on one machine

Effects = Mapping[str, Mapping[str, float]]


def arguments(names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Random values of a place's arguments, and both at rest and where nothing acts."""
    random = np.random.default_rng(5)
    values = {name: np.concatenate([[0.0, 0.0], random.standard_normal(60)]) for name in names}
    values["dt"], values["gear"] = np.full(62, STEP_S), np.full(62, GEAR)
    values["dynamic"], values["static"] = np.full(62, 0.05), np.full(62, 0.1)
    values["begins"] = np.arange(62) == 0
    values["limit"] = np.full(62, 300.0)
    values["volts"] = np.abs(values.get("volts", np.zeros(1)))
    return values


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_effect_does_nothing_at_its_neutral_settings(name):
    """To the last bit, wherever it acts; and its own states stay at 0, where they start, but for the drive's."""
    effect = CATALOGUE[name]
    own, states = [*effect.neutral.values()], [0.0] * len(effect.states)
    for place in effect.places:
        names = PLACES[place.__name__]
        values, acts = arguments(names), compiled(place)
        renewed = states and place.__name__ in STAGES  # a controller's memory goes on with what passes it
        if renewed and place.__name__ == "drive_output" and "sampled" in effect.states:
            states[effect.states.index("sampled")] = 1.0  # as `speed_sample` has left it
        for row in zip(*(values[one] for one in names)):
            told = acts(*row, *own, *states)
            if renewed:
                told, states = told[0], [*told[1:]]
            assert told == row[0], f"{name} acts on {place.__name__}"
    if effect.advance_states is not None:
        values, advances = arguments(ADVANCE), compiled(effect.advance_states)
        for row in zip(*(values[one] for one in ADVANCE)):
            assert advances(*row, *own, *states) == (*states,)


# --- the kernels ------------------------------------------------------------------------------------------------------


def population() -> np.ndarray:
    """(LANES + 3, 8): healthy, and others that differ in all faults."""
    return np.concatenate([[HEALTHY], 0.4 * np.random.default_rng(0).random((LANES + 2, 8))])


def monitored(stack: Stack, effects: Effects, demand: np.ndarray, k: np.ndarray) -> np.ndarray:
    """The Monitor Model's signals: (4, n, values)."""
    rows = monitor_rows(ACTUATOR, k, stack, effects)
    result = np.empty((len(rows), STEPS // PER_VALUE, 4, LANES))
    load, supply = np.full(STEPS, LOAD_NM), np.ones(STEPS)
    state = initial_state(ACTUATOR, len(rows), stack=stack)
    stack.monitor.traces(state, rows, NOTHING, demand, load, supply, PER_VALUE, 1, STEP_S, result)
    return result.transpose(2, 0, 3, 1).reshape(4, -1, STEPS // PER_VALUE)[:, : len(k)]


def referred(stack: Stack, effects: Effects, demand: np.ndarray) -> np.ndarray:
    """The Reference Model's signals: (11, samples)."""
    result = np.empty(((STEPS - 1) // 10, 11))
    rows = reference_rows(ACTUATOR, HEALTHY, stack, effects)
    state = initial_reference_state(ACTUATOR, stack=stack)
    stack.reference.run(state, rows, NOTHING, demand, np.full(STEPS, LOAD_NM), 10, 10, 1e-6, result)
    return result.T


def needed(stack: Stack, effects: Effects) -> np.ndarray:
    """The current that a motion needs: (LANES, samples)."""
    time = np.linspace(0.0, 1.0, 500)
    motion = [50.0 * np.sin(2.0 * np.pi * time + phase) for phase in (0.0, 1.0, 2.0)]
    result = np.empty((1, 500, LANES))
    rows = monitor_rows(ACTUATOR, population()[:LANES], stack, effects)
    stack.inverse.currents(rows, *motion, np.full(500, LOAD_NM), np.zeros(500), 0.1, result)
    return result[0].T


def demand_of(name: str) -> np.ndarray:
    return COMMANDS[name].at(np.arange(STEPS) * STEP_S)


def assert_alike(one: np.ndarray, other: np.ndarray) -> None:
    """Each signal to rounding, of its own size."""
    for a, b in zip(one, other):
        assert np.all(np.isfinite(a)) and np.max(np.abs(a - b)) <= _ROUNDING * np.max(np.abs(b))


@pytest.mark.parametrize("name", COMMANDS)
def test_the_library_at_rest_is_the_bare_model(name):
    bare, library = own_stack(ACTUATOR), library_stack(ACTUATOR)
    demand, k = demand_of(name), population()
    assert_alike(monitored(library, {}, demand, k), monitored(bare, {}, demand, k))
    assert_alike(referred(library, {}, demand), referred(bare, {}, demand))


def test_the_library_at_rest_needs_the_bare_models_current():
    assert_alike(needed(library_stack(ACTUATOR), {}), needed(own_stack(ACTUATOR), {}))


OWN = ("torsional_compliance", "stribeck_friction+torque_ripple")  # with states, and with two places


@pytest.mark.long
@pytest.mark.parametrize("name", ["chirp", "step"])
@pytest.mark.parametrize("names", OWN)
def test_a_models_own_stack_gives_the_librarys_signals(names, name):
    effects = {one: find(one).settings({}) for one in names.split("+")}
    own, library = own_stack(ACTUATOR, effects), library_stack(ACTUATOR)
    demand, k = demand_of(name), population()
    signals = monitored(library, effects, demand, k)
    assert_alike(signals, monitored(own, effects, demand, k))
    with pytest.raises(AssertionError):
        assert_alike(signals, monitored(library, {}, demand, k))


def test_a_models_own_stack_gives_the_librarys_reference_and_current():
    effects = {"presliding_friction": find("presliding_friction").settings({})}
    own, library = own_stack(ACTUATOR, effects), library_stack(ACTUATOR)
    assert_alike(referred(library, effects, demand_of("chirp")), referred(own, effects, demand_of("chirp")))
    effects = {"asymmetric_friction": find("asymmetric_friction").settings({})}
    own = own_stack(ACTUATOR, effects)
    assert_alike(needed(library, effects), needed(own, effects))


def test_the_librarys_lanes_are_single_runs():
    """Each lane has another effect on, at its strongest; bit for bit."""
    library, demand = library_stack(ACTUATOR), demand_of("chirp")
    strong = [{CATALOGUE[name].parameters[0].name: CATALOGUE[name].severities[2]} for name in CATALOGUE]
    alone = [{name: CATALOGUE[name].settings(one)} for name, one in zip(CATALOGUE, strong)]
    together: dict[str, dict[str, np.ndarray]] = {}
    for lane, effects in enumerate(alone):
        for name, settings in effects.items():
            for parameter, value in settings.items():
                at_rest = np.full(len(alone), CATALOGUE[name].neutral[parameter])
                together.setdefault(name, {})[parameter] = at_rest
                at_rest[lane] = value
    lanes = monitored(library, together, demand, np.tile(HEALTHY, (len(alone), 1)))  # pyright: ignore[reportArgumentType]
    for lane, effects in enumerate(alone):
        np.testing.assert_array_equal(lanes[:, lane], monitored(library, effects, demand, HEALTHY[None])[:, 0])


# --- which one is taken -----------------------------------------------------------------------------------------------


def test_what_the_library_has_is_run_in_it():
    library = library_stack(ACTUATOR)
    for names in (["dead_time", "hinge_moment"], ["cogging_torque", "cogging_torque_2"], LIBRARY):
        assert stack_at_hand(ACTUATOR, names, "reduced", "run") is library
    assert stack_at_hand(ACTUATOR, [], "reduced", "run") is own_stack(ACTUATOR)
    own = user_torque("a*omega**3").name
    for names in ([own], [own, "cogging_torque"], ["cogging_torque_3"]):
        assert stack_at_hand(ACTUATOR, names, "reduced", "run") is own_stack(ACTUATOR, names)


def test_what_is_compared_goes_in_the_library_and_what_is_searched_has_its_own(monkeypatch):
    monkeypatch.setattr(
        compiled_simulation, "is_known", lambda *parts: False
    )  # whatever an earlier run has left in the cache
    recording, effects = simulated(Run(duration_s=0.02), ACTUATOR, HEALTHY), {"dead_time": {}}
    assert ClosedLoop([recording], ACTUATOR, effects=effects).stack is library_stack(ACTUATOR)
    assert InverseDynamics([recording], ACTUATOR, effects=effects).stack is library_stack(ACTUATOR)
    assert Objective([recording], ACTUATOR, effects=effects).stack is own_stack(ACTUATOR, effects)


TAKEN = """
import sys
from ema_model.actuator import load_actuator
from ema_model.simulation.pack import library_stack, own_stack, stack_at_hand
from ema_model.simulation.pack import compile_ahead, compile_here, is_compiled, wait_for
actuator, names = load_actuator(), ["winding_resistance"]
assert stack_at_hand(actuator, names, "reduced", "currents") is library_stack(actuator)
own = own_stack(actuator, names)
assert stack_at_hand(actuator, names, "reduced", "currents") is library_stack(actuator)
compile_ahead([(own, "currents")])
wait_for(own, "currents")
assert is_compiled(own, "currents") and not own.inverse.currents.signatures, "not compiled here"
assert stack_at_hand(actuator, names, "reduced", "currents") is own
assert stack_at_hand(actuator, names, "reduced", "traces") is library_stack(actuator), "another kernel"
compile_here(own, "currents")
assert own.inverse.currents.stats.cache_hits
"""


def test_a_models_own_stack_is_taken_once_another_process_has_compiled_it(tmp_path):
    environment = {**os.environ, "EMAVIZ_CACHE_DIR": str(tmp_path), "EMAVIZ_COMPILE_AHEAD": "1"}
    found = subprocess.run([sys.executable, "-c", TAKEN], env=environment, capture_output=True, text=True, timeout=300)
    assert found.returncode == 0, found.stderr


def test_a_kernel_that_has_run_is_compiled():
    monitored(own_stack(ACTUATOR), {}, demand_of("chirp"), HEALTHY[None])
    assert is_compiled(own_stack(ACTUATOR), "traces")
