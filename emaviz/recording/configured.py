"""With what settings a recording was made, and where each of its measurements stands on sim_time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.text import Facts


def configured(
    settings: Mapping[str, Any], names: Sequence[str], times: Sequence[NDArray[np.float64]], shifts: Sequence[float]
) -> Facts:
    """names, times, s, and what was added to them, s: of the measurements."""
    facts = {name: str(value) for name, value in settings.items() if value not in (None, [], "")}
    for i, (name, time, shift) in enumerate(zip(names, times, shifts), 1):
        moved = f", moved by {shift:.4g} s" if shift else ""
        facts[f"recording {i}"] = f"{name}: {time[0]:.4g} … {time[-1]:.4g} s{moved}"
    return Facts(facts)
