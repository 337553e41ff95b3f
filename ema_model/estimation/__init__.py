"""Calibration: the actuator's own parameters, fitted to recordings within their tolerances."""

from __future__ import annotations

from ema_model.estimation.calibrate import Calibrated, Calibration, calibrate, default_free
from ema_model.estimation.floor import Floor, floor

__all__ = ["Calibrated", "Calibration", "Floor", "calibrate", "default_free", "floor"]
