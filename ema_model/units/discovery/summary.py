"""The JSON form of the physics that units lack."""

from __future__ import annotations

from typing import Any

from ema_model.actuator.naming import on_axes
from ema_model.comparison.summary import parameter_dict
from ema_model.discovery import Added
from ema_model.discovery import as_dict as of_discovery
from ema_model.quantities.axes import Axes
from ema_model.units.discovery.result import UnitsDiscovered
from ema_model.units.discovery.words import sentences
from ema_model.units.summary import as_dict as of_compared


def as_dict(result: UnitsDiscovered) -> dict[str, Any]:
    """Plain values only."""
    axes = result.actuator.axes
    return {
        "sentences": sentences(result),
        "effects": [
            {
                "name": lack.effect,
                "same_as": list(lack.same_as),
                "all_units": result.is_of_all(lack),
                "units": {unit: _added(one, axes) for unit, one in lack.by_unit.items()},
            }
            for lack in result.lacks
        ],
        "unexplained": list(result.unexplained),
        "undecided": list(result.undecided),
        "discoveries": {unit: of_discovery(one) for unit, one in result.discoveries.items()},
        "compared": of_compared(result.compared),
    }


def _added(one: Added, axes: Axes) -> dict[str, Any]:
    return {
        "name": one.name,
        "parameters": {
            on_axes(f"effects.{one.key}.{name}", axes).name: parameter_dict(parameter)
            for name, parameter in one.parameters.items()
        },
        "chosen": dict(one.chosen),
        "rmse_before": one.rmse_before,
        "rmse_after": one.rmse_after,
        "holdout_rmse_before": one.holdout_before,
        "holdout_rmse_after": one.holdout_after,
    }
