"""The plant that stands for the real actuator, and its runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import WITHOUT_LOOP
from ema_model.commands import Command
from ema_model.errors import InputError, quoted
from ema_model.recordings import Measurement
from ema_model.simulation import pack
from ema_model.simulation.pack import (
    EffectSettings,
    initial_reference_state,
    library_stack,
    own_stack,
    reference_rows,
    stack_at_hand,
    wait_for,
)
from ema_model.simulation.run import (
    NOTHING,
    REFERENCE_SUBSTEPS,
    Run,
    finite,
    reference_steps,
    simulate_monitor,
    simulate_reference,
)

# --- several runs of the Reference Model at once: actuators that differ, under one command ----------------------------

Array = NDArray[np.float64]

SHOWN = ("current_A", "motor_speed_rad_s", "motor_position_rad", "user_position_rad")


def simulate_references(
    command: Command,
    samples: int,
    sample_rate_Hz: float,
    actuator: Actuator,
    k: Array,
    effects: EffectSettings,
    *,
    load_Nm: ArrayLike,
    start_rad: ArrayLike,
    start_speed_rad_s: ArrayLike,
    start_play_rad: ArrayLike,
    start_integral_Nm: ArrayLike,
    start_time_s: float = 0.0,
    before: Array = NOTHING,
) -> dict[str, Array]:
    """Signals of `SHOWN` after the start, for k (n, 8): (n, samples) each, as `simulate_reference` gives for one.

    All else is a number or (n,): parameters of the actuator and of effects, the load, and the start.
    Raises FloatingPointError if one diverges.
    """
    run = Run(command, samples / sample_rate_Hz, sample_rate_Hz)
    stack = stack_at_hand(actuator, effects, "reduced", "runs")
    times, period, dt = reference_steps(run)
    wait_for(stack, "runs")
    lanes = stack.reference.RUNS
    if len(k) > lanes:
        raise ValueError(f"{len(k)} runs at once; {lanes} are the most")
    load = np.broadcast_to(np.asarray(load_Nm, dtype=float), len(k))
    result = np.empty((run.samples, len(SHOWN), lanes))
    stack.reference.runs(
        initial_reference_state(
            actuator, start_rad, start_speed_rad_s, start_play_rad, stack, start_integral_Nm, start_time_s
        ),
        reference_rows(actuator, k, stack, effects),
        before,
        command.at(times),
        np.pad(load, (0, lanes - len(k)), mode="edge"),
        period,
        REFERENCE_SUBSTEPS,
        dt / REFERENCE_SUBSTEPS,
        result,
    )
    shown: dict[str, Array] = dict(zip(SHOWN, result.transpose(1, 2, 0)[:, : len(k)]))
    for lane in range(len(k)):
        one = {name: values[lane] for name, values in shown.items()}
        finite({**one, "time_s": run.time_s[1:]}, "the reference model", actuator.axes)
    return shown


# --- which model plays the plant: the Reference Model, or the Monitor Model where there is none -----------------------

FITNESSES = ("filtered", "raw")
# Of what is identified, by the fitness that it is for.
_RATE_HZ: dict[str, float] = dict(zip(FITNESSES, (10_000.0, 100_000.0)))


def can_be_explored(actuator: Actuator) -> bool:
    """Whether any model can follow a command."""
    return actuator.controller.kind not in WITHOUT_LOOP


def note(actuator: Actuator) -> str:
    """What the page says of it in one sentence; empty where the plant is the Reference Model."""
    if actuator.has_reference_model:
        return ""
    if not can_be_explored(actuator):
        return (
            f"{actuator.name} cannot be explored: its controller is not described, so that no command can be "
            "simulated; Compare and Discover take its recordings all the same."
        )
    return (
        f"{actuator.name} has no three-phase reference model, which is of a cascade with a hysteresis inverter: the "
        "plant here is the monitor model with these faults, it starts at rest and has no phase currents."
    )


def is_compiled(actuator: Actuator, effects: Mapping[str, Any]) -> bool:
    """Whether the next simulation with these effects begins at once."""
    kernel = _kernel(actuator)
    return pack.is_compiled(stack_at_hand(actuator, effects, "reduced", kernel), kernel)


def compile_own(actuator: Actuator) -> None:
    """Compiles what every simulation without hidden effects takes, of an actuator that has effects in its file too."""
    pack.compile_here(own_stack(actuator), _kernel(actuator))


def compile_behind(actuator: Actuator) -> None:
    """Begins to compile what the first hidden effect and the first discovery need, in another process."""
    library = library_stack(actuator)
    pack.compile_ahead([(library, _kernel(actuator)), (library, "traces")], urgent=False)


def simulate(
    run: Run,
    actuator: Actuator,
    k: ArrayLike,
    effects: Mapping[str, Any],
    *,
    start_rad: float | None = None,
    start_speed_rad_s: float = 0.0,
    start_play_rad: float = 0.0,
) -> Measurement:
    """The plant's signals; of the start, which is as `simulate_reference` takes it, a Monitor Model takes the angle.

    Raises InputError for an actuator that no command can be simulated of, FloatingPointError if the model diverges.
    """
    if actuator.has_reference_model:
        return simulate_reference(
            run,
            actuator,
            k,
            effects,
            start_rad=start_rad,
            start_speed_rad_s=start_speed_rad_s,
            start_play_rad=start_play_rad,
        )
    _require(actuator)
    return simulate_monitor(run, actuator, k, effects, start_rad=start_rad)


def simulated(
    run: Run, actuator: Actuator, k: ArrayLike, fitness: str = "filtered", effects: Mapping[str, Any] | None = None
) -> Measurement:
    """A recording of the Reference Model for identification, sampled at the fitness's own rate (10 or 100 kHz)."""
    if fitness not in FITNESSES:
        raise InputError(f"no fitness {quoted(fitness)!r}; fitnesses are {', '.join(FITNESSES)}")
    return simulate_reference(_at_rate(run, fitness), actuator, k, effects)


def to_identify(run: Run, actuator: Actuator, k: ArrayLike, fitness: str, effects: Mapping[str, Any]) -> Measurement:
    """The plant as an identification takes it, sampled at its fitness's rate; raises as `simulate`."""
    if actuator.has_reference_model:
        return simulated(run, actuator, k, fitness, effects)
    _require(actuator)
    return simulate_monitor(_at_rate(run, fitness), actuator, k, effects)


def _at_rate(run: Run, fitness: str) -> Run:
    return replace(run, sample_rate_Hz=_RATE_HZ[fitness])


def _kernel(actuator: Actuator) -> str:
    return "run" if actuator.has_reference_model else "traces"


def _require(actuator: Actuator) -> None:
    if not can_be_explored(actuator):
        raise InputError(note(actuator))
