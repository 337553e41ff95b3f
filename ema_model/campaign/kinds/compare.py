"""Where the model fails beside recordings, and what explains it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from ema_model.campaign.kinds.kind import FLAG, NUMBER, NUMBERS, TEXT, Kind
from ema_model.campaign.plan_axes import TaskInputs
from ema_model.comparison import compare
from ema_model.quantities import explanation_title


@dataclass(frozen=True)
class Settings:
    """As `emaviz compare` has them."""

    calibrate: bool = True


def _run(inputs: TaskInputs, settings: Settings, seed: int) -> dict[str, Any]:
    found = compare(inputs.fitted, inputs.actuator, calibrate=settings.calibrate, holdout=inputs.held).to_dict()
    first = next((one for one in found["explained_by"] if one["significant"]), {})
    error, calibration = found["signals"][found["primary"]], found["calibration"]
    return {
        "adequate": found["adequate"],
        "sentence": found["sentences"][0],
        "signal": found["primary"],
        "over_floor": found["over_floor"],
        "floor_band": found["floor_band"],
        "rmse": error["rmse"],
        "noise_floor": error["noise_floor"],
        "variable": first.get("variable"),
        "modulator": first.get("modulator"),
        "r2": first.get("r2"),
        "orders": [float(one["order"]) for one in found["orders"]],
        "converged": None if calibration is None else calibration["converged"],
    }


def _told(rows: list[dict[str, Any]]) -> dict[str, Any]:
    first = Counter(explanation_title(row["variable"], row["modulator"]) for row in rows)
    orders = Counter(f"{row['orders'][0]:g}" for row in rows if row["orders"])
    return {
        "adequate": sum(row["adequate"] for row in rows),
        "explained first by": ", ".join(f"{name} {count}" for name, count in first.most_common(4)),
        "strongest order": ", ".join(f"{order}: {count}" for order, count in orders.most_common(3)) or "–",
        "error over floor, median": f"{np.median([row['over_floor'] for row in rows]):.2f}",
        "in its 90 % band": sum(low <= row["over_floor"] <= high for row in rows for low, high in [row["floor_band"]]),
    }


KIND = Kind(
    title="Comparison",
    settings=Settings,
    columns=pa.schema(
        [
            ("adequate", FLAG),
            ("sentence", TEXT),
            ("signal", TEXT),  # whose residual is explained
            ("over_floor", NUMBER),  # pooled over signals
            ("floor_band", NUMBERS),
            ("rmse", NUMBER),
            ("noise_floor", NUMBER),
            ("variable", TEXT),  # of the first significant explanation; null where there is none
            ("modulator", TEXT),
            ("r2", NUMBER),
            ("orders", NUMBERS),  # per turn, the strongest first
            ("converged", FLAG),
        ]
    ),
    run=_run,
    seconds=lambda settings: 4.0,
    told=_told,
)
