"""A measurement as the model needs it: under the names inside, with an equivalent current."""

from __future__ import annotations

from dataclasses import replace

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from ema_model.files.refusal import listed
from ema_model.recordings.equivalent_current import with_current
from ema_model.recordings.measurement import Measurement


def prepared(measurement: Measurement, actuator: Actuator) -> Measurement:
    """The measurement with the signals' rotary names, which the model has, and a current from its phase currents.

    One that is so already stays as it is.  Raises InputError for one that was prepared for other axes: the signals
    of the axes that it was read for are all that it has left.
    """
    if measurement.axes is not None:
        if measurement.axes != actuator.axes:
            raise InputError(f"{measurement.name}: it was read for an actuator with other axes; read it for this one")
        return measurement
    axes = actuator.axes
    others = axes.of_other_axes(measurement)
    inside = replace(measurement, signals=axes.inside(measurement.signals), axes=axes, of_other_axes=others)
    if others:
        inside = inside.with_notes(f"left aside, as the actuator's axes are of another kind: {listed(others)}")
    made = with_current(inside, actuator.motor.pole_pairs, actuator.motor.rotor_offset_rad)
    if made is inside:
        return made
    return replace(made, reading=replace(made.reading, made=("current_A",)))
