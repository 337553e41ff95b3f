"""Recordings of a real or simulated actuator: signals on one time base, read, checked, resampled and written."""

from __future__ import annotations

from ema_model.measurement.checks import check_needed
from ema_model.measurement.measurement import Measurement
from ema_model.measurement.read import read_measurement
from ema_model.measurement.signals import SIGNALS, Signal
from ema_model.measurement.write import check_target, write_measurement

__all__ = [
    "SIGNALS",
    "Measurement",
    "Signal",
    "check_needed",
    "check_target",
    "read_measurement",
    "write_measurement",
]
