"""Several runs of the Reference Model at once: actuators that differ, under one command."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.commands import Command
from ema_model.simulation.one_stack import stack_at_hand
from ema_model.simulation.pack import EffectSettings, initial_reference_state, reference_rows
from ema_model.simulation.precompile import wait_for
from ema_model.simulation.run import REFERENCE_SUBSTEPS, Run, finite, reference_steps

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
