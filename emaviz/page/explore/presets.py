"""Ready-made faults: those of the thesis's tables, each low and high, and its multi-fault case."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ema_model.faults import HEALTHY, vector

_MULTI_FAULT = np.array([0.0133, 0.05, 0.003, 0.0, 0.0, 0.012, 0.5, 0.35])  # T 5.3
CUSTOM = "custom"

PRESETS: dict[str, NDArray[np.float64]] = {
    "healthy": HEALTHY,
    **{
        f"{title}, {severity}": vector({name: value})
        for name, title in (
            ("k1", "friction"),
            ("k2", "backlash"),
            ("k3", "short circuit in phase A"),
            ("k6", "eccentricity"),
            ("k8", "proportional gain"),
        )
        for severity, value in (("low", 0.25), ("high", 0.75))
    },
    "several faults (thesis, T 5.3)": _MULTI_FAULT,
}


def name_of(k: NDArray[np.float64]) -> str:
    """The preset that k is, or that it is none."""
    return next((name for name, preset in PRESETS.items() if np.allclose(k, preset, atol=1e-9)), CUSTOM)
