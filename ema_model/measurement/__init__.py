"""Recordings of an actuator, real or simulated: one set of names and units, in and out of files."""

from ema_model.measurement.measurement import Measurement
from ema_model.measurement.read import read_measurement
from ema_model.measurement.signals import SIGNALS, Signal
from ema_model.measurement.write import write_measurement

__all__ = ["SIGNALS", "Measurement", "Signal", "read_measurement", "write_measurement"]
