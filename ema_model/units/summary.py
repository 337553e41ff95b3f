"""The JSON form of what units differ in."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ema_model.actuator.naming import on_axes
from ema_model.units.result import Difference, UnitsCompared
from ema_model.units.words import sentences


def as_dict(result: UnitsCompared) -> dict[str, Any]:
    """Plain values only; parameters as the actuator's file calls them."""

    def shown(path: str) -> str:
        return on_axes(path, result.actuator.axes).path

    def difference(one: Difference) -> dict[str, Any]:
        return {
            "unit": one.unit,
            "parameter": shown(one.parameter),
            "same_as": [shown(path) for path in one.alike],
            "change": one.change,
            "interval90": list(one.change90),
            "share": one.share,
            "share_interval90": None if one.share90 is None else list(one.share90),
            "evidence": one.evidence,
            "held_out_evidence": one.held_out,
        }

    def alone(unit: int) -> dict[str, Any]:
        return {
            shown(path): {
                "value": float(one.value[unit]),
                "interval90": list(one.interval90(unit)),
                "unit": result.of_type[path].unit,
            }
            for path, one in result.alone.items()
        }

    moved = result.transfer
    return {
        "sentences": sentences(result),
        "warnings": list(result.warnings),
        "units": [
            {
                "name": name,
                "recordings": list(result.recordings[i]),
                "holdout": list(result.held_out[i]),
                "error": float(result.errors[i]),
                "parameters": alone(i),
            }
            for i, name in enumerate(result.units)
        ],
        "differences": [difference(one) for one in result.differences],
        "contradicted": [difference(one) for one in result.dropped],
        "of_recordings": [
            {
                "unit": one.unit,
                "recording": one.recording,
                "quantity": one.quantity,
                "value": one.value,
                "interval90": list(one.value90),
                "in": one.in_unit,
                "allowed_for": one.allowed_for,
            }
            for one in result.of_recordings
        ],
        "scattering": [shown(path) for path in result.scattering],
        "type": {shown(path): asdict(one) | {"mean90": list(one.mean90)} for path, one in result.of_type.items()},
        "transfer": {
            "signal": result.actuator.axes.signal(moved.signal),
            "rmse": moved.error.tolist(),
            "noise_floor": moved.floor.tolist(),
            "floors": moved.floors.tolist(),
        },
        "needed": [
            {"unit": one.unit, "parameter": shown(one.parameter), "like": one.recording or None} for one in result.needs
        ],
    }
