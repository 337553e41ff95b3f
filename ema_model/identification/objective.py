"""How far the Monitor Model is from recordings: the fitness that the optimisers minimise (T 5.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError, quoted
from ema_model.models.closed_loop import ClosedLoop
from ema_model.models.loop_window import BLOCK_S, LoopWindow
from ema_model.physics.rows import LANES
from ema_model.recordings import Measurement
from ema_model.simulation.pack import initial_state, monitor_rows
from ema_model.simulation.plant import FITNESSES
from ema_model.simulation.run import traced
from ema_model.stacks import exclusive

Array = NDArray[np.float64]


class Objective(ClosedLoop):
    """Root-mean-square error of I_3eq, A, for a population of k, over one recording or several.

    `filtered` compares means over 0.5 ms, which removes the chopping ripple that no low-fidelity model
    can follow; `raw` compares every sample, as the thesis does.  k counts from the healthy actuator, whatever faults
    its file knows of.
    """

    def __init__(
        self,
        measurements: Sequence[Measurement],
        actuator: Actuator,
        *,
        effects: Mapping[str, Mapping[str, float]] | None = None,
        circuit: str = "reduced",
        fitness: str = "filtered",
    ) -> None:
        if fitness not in FITNESSES:
            raise InputError(f"no fitness {quoted(fitness)!r}; fitnesses are {', '.join(FITNESSES)}")
        super().__init__(
            measurements,
            replace(actuator, faults={}),
            effects=effects,
            circuit=circuit,
            own_kernels=True,
            block_s=BLOCK_S if fitness == "filtered" else 0.0,
        )
        for measurement in self.measurements:
            measurement.require("current_A")
        self.fitness = fitness
        self.target = np.concatenate([self._target(window) for window in self.windows])
        self.blocks = len(self.target)
        self._groups = self._grouped()

    def at_longer_steps(self, most_s: float) -> Self:
        """As in `Model`."""
        longer = super().at_longer_steps(most_s)
        longer._groups = longer._grouped()
        return longer

    def __call__(self, k: ArrayLike) -> Array:
        """RMSE, A, of each individual: k (n, 8) → (n,); infinite where the model diverges."""
        k = np.atleast_2d(np.asarray(k, dtype=float))
        total = np.zeros(-(-len(k) // LANES) * LANES)
        for group in self._groups:
            actuator = self.actuator.varied(group.windows[0].values)
            rows = monitor_rows(actuator, k, self.stack, self.effects)
            states = np.stack([self._state(window, k, actuator) for window in group.windows])
            result = np.empty((len(group.windows), len(rows), LANES))
            exclusive(
                self.stack.monitor.squared_errors,
                states,
                rows,
                group.command,
                group.load,
                group.supply,
                group.first_step,
                group.target,
                np.ones_like(group.target),
                group.first_block,
                group.steps_per_block,
                group.step_s,
                result,
                jobs=len(states) * len(rows),
            )
            total += result.sum(axis=0).ravel()
        rmse = np.sqrt(total[: len(k)] / self.blocks)
        # comparisons take a NaN for "not larger": a lane can come back to finite numbers, but is no answer
        sound = np.isfinite(rmse) & np.isfinite(k).all(axis=1)
        return np.where(sound, rmse, np.inf)

    def currents(self, k: ArrayLike, actuator: Actuator | None = None) -> Array:
        """What `__call__` compares with `target`, A: k (n, 8) → (n, blocks), the recordings one after another.

        The parameters of `actuator` may be arrays (n,), one value for each individual.
        """
        k = np.atleast_2d(np.asarray(k, dtype=float))
        parts = []
        for window in self.windows:
            one = (actuator or self.actuator).varied(window.values)
            rows = monitor_rows(one, k, self.stack, self.effects)
            run = window.command, window.load, window.supply
            state = self._state(window, k, one)
            result = traced(self.stack, state, rows, run, window.steps_per_block, 1, window.step_s)
            parts.append(result[:, :, 0, :].transpose(0, 2, 1).reshape(len(rows) * LANES, -1)[: len(k)])
        return np.concatenate(parts, axis=1)

    def _grouped(self) -> list[_Group]:
        return [_Group(windows, [self._target(w) for w in windows]) for windows in _alike(self.windows)]

    def _target(self, window: LoopWindow) -> Array:
        """The window's equivalent current, A, (blocks,), the sensor's gain and bias taken off."""
        sensors = self.actuator.varied(window.values).sensors
        return (window.measured["current_A"] - sensors.current_bias_A) / sensors.current_gain

    def _state(self, window: LoopWindow, k: Array, actuator: Actuator) -> Array:
        return initial_state(
            actuator,
            -(-len(k) // LANES),
            window.user_rad,
            window.speed_rad_s,
            window.play_rad,
            self.stack,
            window.integral_Nm(actuator, k),
        )


def _alike(windows: Sequence[LoopWindow]) -> list[list[LoopWindow]]:
    """Windows grouped by their sampling and own values, so that one kernel call serves each group."""
    groups: dict[Any, list[LoopWindow]] = {}
    for window in windows:
        groups.setdefault(
            (window.steps_per_block, round(window.step_s, 12), *sorted(window.values.items())), []
        ).append(window)
    return list(groups.values())


class _Group:
    """Windows of one sampling and one actuator, laid one after another."""

    def __init__(self, windows: list[LoopWindow], targets: list[Array]) -> None:
        self.windows = windows
        self.steps_per_block = windows[0].steps_per_block
        self.step_s = windows[0].step_s
        self.command = np.concatenate([window.command for window in windows])
        self.load = np.concatenate([window.load for window in windows])
        self.supply = np.concatenate([window.supply for window in windows])
        self.target = np.concatenate(targets)
        self.first_step = np.cumsum([0] + [len(window.command) for window in windows[:-1]])
        self.first_block = np.cumsum([0] + [window.blocks for window in windows])
