"""What of a recording's sampling a model can follow: checked before anything is laid out in steps of the model."""

from __future__ import annotations

from collections.abc import Sequence

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from ema_model.recordings import Measurement
from ema_model.simulation.run import FASTEST_HZ, SLOWEST_HZ, steps_per_sample

MOST_STEPS = 20_000_000  # of the model, over all recordings at once: 200 s at 10 µs, half a gigabyte of inputs
_MOST_FILLED = 10.0  # samples on an even grid for each that was recorded, before its time counts as full of gaps
_SLOWEST = 100.0  # half widths of the motion's filter
_ADVICE = "check the unit of time_s"


def on_even_grid(measurement: Measurement) -> Measurement:
    """The measurement on a grid of its own median period; InputError where that would mostly fill gaps."""
    period = measurement.sample_period_s
    if not period > 0.0:  # NaN: every run is one sample
        raise InputError(f"{measurement.name}: no run has two samples; check the column segment")
    if measurement.is_uniform:
        return measurement
    if measurement.duration_s > _MOST_FILLED * measurement.samples * period:
        seen = f"{measurement.samples} samples, {period:g} s apart at the median, last for {measurement.duration_s:g} s"
        raise InputError(f"{measurement.name}: {seen}; {_ADVICE}, or number the runs between gaps in a column segment")
    return measurement.resampled(period)


def check_steps(measurements: Sequence[Measurement], parts: Sequence[list[slice] | None], actuator: Actuator) -> None:
    """Raises InputError where a closed loop cannot be simulated beside recordings on even grids, whole or in parts."""
    total, steps = 0, actuator.step_s
    for measurement, slices in zip(measurements, parts):
        period = measurement.sample_period_s
        if actuator.has_reference_model and not 0.999 / FASTEST_HZ <= period <= 1.001 / SLOWEST_HZ:
            raise InputError(
                f"{measurement.name}: its sampling period of {period:g} s is not between {1.0 / FASTEST_HZ:g} and "
                f"{1.0 / SLOWEST_HZ:g} s, which the reference model can follow; {_ADVICE}, or record at another rate"
            )
        samples = sum(one.stop - one.start for one in slices or measurement.runs)
        total += samples * steps_per_sample(period, steps)
        if total > MOST_STEPS:
            raise InputError(
                f"{measurement.name}: {samples} samples every {period:g} s take it to {total:.2g} steps of the model "
                f"({steps:g} s), and at most {MOST_STEPS:g} are simulated; {_ADVICE}, or take a shorter part"
            )


def check_period(measurement: Measurement, filter_s: float) -> None:
    """Raises InputError where samples are too far apart to tell speed and acceleration."""
    period = measurement.sample_period_s
    if period > _SLOWEST * filter_s:
        seen = f"its sampling period of {period:g} s is far too long to differentiate the motion over {filter_s:g} s"
        raise InputError(f"{measurement.name}: {seen}; {_ADVICE}, or record faster")
