"""What every fit shares — floors, unknowns with their priors, the problem, descent — and calibration, which is one."""

from __future__ import annotations

from ema_model.estimation.calibrate import (
    Calibrated,
    Calibration,
    after_fit,
    calibrate,
    default_free,
    of_unseen,
    taken_up,
)
from ema_model.estimation.noise import Floor, floor

__all__ = [
    "Calibrated",
    "Calibration",
    "Floor",
    "after_fit",
    "calibrate",
    "default_free",
    "floor",
    "of_unseen",
    "taken_up",
]
