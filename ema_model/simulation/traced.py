"""The Monitor Model's and inverse dynamics' kernels called for a population, its blocks of lanes side by side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ema_model.physics.rows import LANES
from ema_model.side_by_side import blocks
from ema_model.simulation.precompile import wait_for
from ema_model.stacks import Stack

Array = NDArray[np.float64]
AnyFloat = NDArray[np.floating]


def traced(
    stack: Stack,
    state: Array,
    rows: Array,
    run: tuple[AnyFloat, AnyFloat, AnyFloat],
    period: int,
    group: int,
    step_s: float,
) -> Array:
    """The four signals of `monitor.traces`: (blocks, values, 4, LANES).

    run: command, load and supply at each step.  state and rows: a block of lanes each; state is left as it is at the
    end.
    """
    wait_for(stack, "traces")
    result = np.empty((len(rows), len(run[0]) // (period * group), 4, LANES))

    def simulate(part: slice) -> None:
        stack.monitor.traces(state[part], rows[part], *run, period, group, step_s, result[part])

    blocks(simulate, len(rows))
    return result


def needed_currents(stack: Stack, rows: Array, motion: tuple[Array, Array, Array, Array, Array], still: float) -> Array:
    """The current of `inverse.currents`, A: (blocks, samples, LANES).

    motion: position, speed, acceleration, load and time at each sample; rows: a block of lanes each.
    """
    wait_for(stack, "currents")
    result = np.empty((len(rows), len(motion[0]), LANES))

    def compute(part: slice) -> None:
        stack.inverse.currents(rows[part], *motion, still, result[part])

    blocks(compute, len(rows))
    return result
