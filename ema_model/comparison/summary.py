"""A comparison in plain numbers, as `emaviz compare --json` writes it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ema_model.actuator.naming import on_axes
from ema_model.comparison.events import Event
from ema_model.comparison.result import Comparison, SignalError
from ema_model.estimation import Calibrated, Calibration
from ema_model.quantities.axes import Axes


def as_dict(comparison: Comparison) -> dict[str, Any]:
    """Everything but the series, in numbers and texts that JSON can hold; unknown numbers are None."""
    return plain(
        {
            "adequate": comparison.adequate,
            "over_floor": comparison.over_floor,
            "floor_band": list(comparison.floor_band),
            "sentences": list(comparison.sentences),
            "warnings": list(comparison.warnings),
            "signals": {name: _error(error) for name, error in comparison.signals.items()},
            "primary": comparison.primary,
            "calibration": None
            if comparison.calibration is None
            else calibration_dict(comparison.calibration, comparison.actuator.axes),
            "explained_by": [
                {
                    "variable": one.variable,
                    "modulator": one.modulator,
                    "r2": one.r2,
                    "significant": one.significant,
                    "signal": one.signal,
                    "sentence": one.sentence,
                }
                for one in comparison.explained_by
            ],
            "orders": [
                {"order": one.order, "amplitude": one.amplitude, "phase_rad": one.phase} for one in comparison.orders
            ],
            "worst_regions": [
                {
                    "signal": one.signal,
                    "variable": one.variable,
                    "from": one.low,
                    "to": one.high,
                    "rmse": one.rmse,
                    "mean": one.mean,
                    "sentence": one.sentence,
                }
                for one in comparison.worst_regions
            ],
            "events": [event_dict(one) for one in comparison.events],
            "recordings": [
                {
                    "name": one.name,
                    "notes": list(one.measurement.notes),
                    "health": one.health.as_dict(),
                    "signals": {name: _error(error) for name, error in one.errors.items()},
                }
                for one in comparison.recordings
            ],
            "holdout": [
                {"name": one.name, "signals": {name: _error(error) for name, error in one.errors.items()}}
                for one in comparison.holdout
            ],
        }
    )


def event_dict(one: Event) -> dict[str, Any]:
    """A step at one moment of a recording."""
    return {
        "recording": one.name,
        "time_s": one.time_s,
        "signal": one.signal,
        "change": one.change,
        "by_direction": one.by_direction,
        "share": one.share,
        "sentence": one.sentence,
    }


def _error(error: SignalError) -> dict[str, float]:
    return {
        "rmse": error.rmse,
        "nrmse": error.nrmse,
        "noise_floor": error.noise_floor,
        "rmse_initial": error.rmse_initial,
        "mean_absolute": error.mean_absolute,
    }


def calibration_dict(calibration: Calibration, axes: Axes) -> dict[str, Any]:
    """A calibration's parameters by the names in files."""
    return {
        "converged": calibration.converged,
        "evaluations": calibration.evaluations,
        "parameters": {on_axes(name, axes).path: parameter_dict(one) for name, one in calibration.parameters.items()},
        "starts": {name: parameter_dict(one) for name, one in calibration.starts.items()},
        "outside_tolerance": [on_axes(name, axes).path for name in calibration.outside_tolerance],
        "confounded": [[on_axes(a, axes).path, on_axes(b, axes).path] for a, b in calibration.confounded],
    }


def parameter_dict(one: Calibrated) -> dict[str, Any]:
    """One calibrated parameter."""
    return {
        "value": one.value,
        "initial": one.initial,
        "interval90": list(one.interval90),
        "unit": one.unit,
        "z": one.z,
        "at_bound": one.at_bound,
    }


def plain(value: Any) -> Any:
    """The value in types that JSON has; numbers that are not finite are None."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value
