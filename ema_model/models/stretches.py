"""Which parts of long recordings are simulated: a fit takes seconds, not the hours that a rig can record."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ema_model.actuator import Actuator
from ema_model.models.loop_window import BLOCK_S
from ema_model.models.sampling import on_even_grid
from ema_model.recordings import Measurement

_FIT_STEPS = 300_000  # of the model over all recordings, for a calibration: 3 s at 1e-5 s
_FIT_BLOCKS = 16_000  # of a closed loop over all recordings, for a calibration: more tell no more, and take longer
_MOST_STEPS = 12_000_000  # for the evaluation: 120 s
_PARTS = 6  # that a long recording is fitted on
_LEAST_S = 0.05
_STEPS_A_SAMPLE = 2.0


def fit_stretches(measurements: Sequence[Measurement], actuator: Actuator) -> list[list[slice] | None] | None:
    """Parts of each recording to calibrate on, spread over its length; None if all can be taken whole."""
    return _stretches(measurements, actuator, _FIT_STEPS, _PARTS, _FIT_BLOCKS)


def evaluation_stretches(measurements: Sequence[Measurement], actuator: Actuator) -> list[list[slice] | None] | None:
    """Parts of each recording to simulate for the residuals; None, whole, for all but very long ones."""
    return _stretches(measurements, actuator, _MOST_STEPS, 10 * _PARTS)


def _stretches(
    measurements: Sequence[Measurement], actuator: Actuator, budget: int, parts: int, most_blocks: float = np.inf
) -> list[list[slice] | None] | None:
    if any(measurement.is_map for measurement in measurements):
        return None
    measurements = [on_even_grid(measurement) for measurement in measurements]  # whose samples the slices count
    if actuator.controller.kind == "unknown":  # a sample costs as much as some steps of a simulation
        steps = [_STEPS_A_SAMPLE * measurement.samples for measurement in measurements]
        blocks = 0.0
    else:
        steps = [measurement.duration_s / actuator.step_s for measurement in measurements]
        blocks = sum(one.duration_s / max(one.sample_period_s, BLOCK_S) for one in measurements)
    share = min(budget / max(sum(steps), 1.0), most_blocks / max(blocks, 1.0))
    if share >= 1.0:
        return None
    return [_of(measurement, share, parts, actuator) for measurement in measurements]


def _of(measurement: Measurement, share: float, parts: int, actuator: Actuator) -> list[slice]:
    """Stretches of the runs, `share` of their length together; the first starts with the recording."""
    period = measurement.sample_period_s
    wanted = share * measurement.samples
    least = max(200, int(_LEAST_S / period))
    count = int(np.clip(wanted // least, 1, parts))
    length = max(least, int(wanted / count))
    runs = measurement.runs
    starts = np.linspace(0, max(0, measurement.samples - length), count).astype(int)
    found: list[slice] = []
    for start in starts:
        run = next(run for run in runs if start < run.stop)
        first = max(run.start, min(start, run.stop - length))
        piece = slice(int(first), int(min(first + length, run.stop)))
        if not found or piece.start >= found[-1].stop:
            found.append(piece)
    return found
