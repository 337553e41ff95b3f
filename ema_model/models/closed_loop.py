"""The actuator in its loop: command and load in, all signals out of the Monitor Model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.effects import find
from ema_model.errors import InputError
from ema_model.models.sampling import check_steps, on_even_grid
from ema_model.models.window import BLOCK_S, Window, cut
from ema_model.physics.rows import LANES
from ema_model.recordings import Measurement
from ema_model.simulation.one_stack import own_stack, stack_at_hand
from ema_model.simulation.pack import initial_state, monitor_rows
from ema_model.simulation.precompile import wait_for
from ema_model.stacks import exclusive

Array = NDArray[np.float64]

_CHUNK = 20_000  # blocks that are simulated at once


class ClosedLoop:
    """Recordings whose command and controller are known, cut into windows that start from their own first sample."""

    starts = True  # a window's start is not known exactly

    def __init__(
        self,
        measurements: Sequence[Measurement],
        actuator: Actuator,
        *,
        effects: Mapping[str, Mapping[str, float]] | None = None,
        circuit: str = "reduced",
        own_kernels: bool = False,
        block_s: float = BLOCK_S,
        stretches: Sequence[list[slice] | None] | None = None,
    ) -> None:
        """own_kernels: whether they are worth waiting for, instead of the library's in the meantime."""
        if not measurements:
            raise InputError("one recording or more is needed")
        self.actuator = actuator
        self.effects = {
            name: find(name, actuator.axes).settings(dict(given)) for name, given in (effects or {}).items()
        }
        self.stack = (
            own_stack(actuator, self.effects, circuit)
            if own_kernels
            else stack_at_hand(actuator, self.effects, circuit, "traces")
        )
        self.recorded = list(measurements)  # before they were put on an even grid
        self.measurements = [on_even_grid(m) for m in measurements]
        chosen = stretches or [None] * len(self.measurements)
        check_steps(self.measurements, chosen, actuator)
        self.windows = [
            window
            for i, (m, parts) in enumerate(zip(self.measurements, chosen))
            for window in cut(m, actuator, recording=i, block_s=block_s, stretches=parts)
        ]

    def signals(
        self,
        window: Window,
        actuator: Actuator | None = None,
        k: ArrayLike | None = None,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
        effects: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> dict[str, Array]:
        """All of `COMPARED` for one window, as its sensors would show them: k (n, 8) → (n, blocks) each.

        k: without it, the actuator's own.  The parameters of `actuator` and effects, turned_rad (the motor's angle at
        the start, rad, beyond the measured one) and play_rad (the same for its place in the play) may be arrays (n,).
        """
        actuator = (actuator or self.actuator).varied(window.values)
        k = np.atleast_2d(np.asarray(actuator.k if k is None else k, dtype=float))
        rows = monitor_rows(actuator, k, self.stack, self.effects if effects is None else effects)
        tau = actuator.transmission.gear_ratio
        state = initial_state(
            actuator,
            len(rows),
            window.user_rad + np.asarray(turned_rad) * tau,
            window.speed_rad_s,
            window.play_rad + np.asarray(play_rad),
            self.stack,
            window.integral_Nm(actuator, k, turned_rad, play_rad),
        )
        wait_for(self.stack, "traces")
        lanes = np.empty((4, len(k), window.blocks))
        steps = window.steps_per_block
        for first in range(0, window.blocks, _CHUNK):  # long recordings would fill the memory with lanes
            part = slice(first, min(first + _CHUNK, window.blocks))
            at = slice(part.start * steps, part.stop * steps)
            result = np.empty((len(rows), part.stop - part.start, 4, LANES))
            exclusive(
                self.stack.monitor.traces,
                state,
                rows,
                window.command[at],
                window.load[at],
                window.supply[at],
                window.steps_per_sample,
                window.samples_per_block,
                window.step_s,
                result,
            )
            lanes[:, :, part] = result.transpose(2, 0, 3, 1).reshape(4, len(rows) * LANES, -1)[:, : len(k)]
        sensors = actuator.sensors
        shown = {
            "current_A": _each(sensors.current_gain) * lanes[0] + _each(sensors.current_bias_A),
            "motor_speed_rad_s": lanes[1],
            "motor_position_rad": lanes[2],
            "user_position_rad": lanes[3],
        }
        late = _each(sensors.delay_s) - self.actuator.sensors.delay_s  # beyond what the window's command has
        if not np.any(late):
            return shown
        return {name: y - late * np.gradient(y, window.block_s, axis=1) for name, y in shown.items()}


def _each(value: ArrayLike) -> Array:
    """One number, or one for each individual, as a column."""
    return np.atleast_1d(np.asarray(value, dtype=float))[:, None]
