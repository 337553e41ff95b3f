"""What the sections of an identification's report are about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ema_model.identification.objective import Objective
from ema_model.identification.run import Identification


@dataclass(frozen=True, eq=False)
class Identified:
    """An answer, what it was fitted to, and how it was asked for."""

    answer: Identification
    objective: Objective
    holdout_rmse: float | None  # A
    configuration: Mapping[str, Any]
