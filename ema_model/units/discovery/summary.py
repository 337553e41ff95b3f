"""The JSON form of the physics that units lack: what each field means, and where it is from."""

from __future__ import annotations

from typing import Annotated, TypedDict

from msgspec import Meta

from ema_model.actuator.naming import on_axes
from ema_model.comparison.summary import ParameterJson, parameter_dict
from ema_model.discovery import Added
from ema_model.discovery import as_dict as of_discovery
from ema_model.discovery.words import DiscoveryJson
from ema_model.quantities.axes import Axes
from ema_model.units.discovery.result import UnitsDiscovered
from ema_model.units.discovery.words import sentences
from ema_model.units.result import UnitsComparedJson
from ema_model.units.result import as_dict as of_compared


class LackOfUnitJson(TypedDict):
    """An effect as one unit's recordings tell it; errors are rms pooled over signals, in floors."""

    name: Annotated[str, Meta(description="the effect, or one that these recordings do not tell from it")]
    parameters: Annotated[dict[str, ParameterJson], Meta(description="that were fitted, by their names in files")]
    chosen: Annotated[dict[str, float], Meta(description="that were not fitted, as a whole order")]
    rmse_before: Annotated[float | None, Meta(description="without it")]
    rmse_after: Annotated[float | None, Meta(description="with it")]
    holdout_rmse_before: Annotated[float | None, Meta(description="of what was not fitted, without it; null: nothing")]
    holdout_rmse_after: Annotated[float | None, Meta(description="of what was not fitted, with it; null: nothing")]


class LackJson(TypedDict):
    """An effect that units lack."""

    name: Annotated[str, Meta(description="as `emaviz effects` lists it")]
    same_as: Annotated[list[str], Meta(description="effects that no unit's recordings tell from it")]
    all_units: Annotated[bool, Meta(description="whether all units lack it")]
    units: Annotated[dict[str, LackOfUnitJson], Meta(description="those that lack it, by name")]


class UnitsDiscoveredJson(TypedDict):
    """Which physical effects the model of a type lacks (with --by or --unit)."""

    sentences: Annotated[list[str], Meta(description="the answer in words, the first one first")]
    effects: Annotated[list[LackJson], Meta(description="what is missing, that of most units first")]
    unexplained: Annotated[list[str], Meta(description="units of which something is left that no effect explains")]
    undecided: Annotated[list[str], Meta(description="units of which nothing can be said")]
    discoveries: Annotated[dict[str, DiscoveryJson], Meta(description="of each unit, by its name")]
    compared: Annotated[UnitsComparedJson, Meta(description="what differs, with what all units lack in the model")]


def as_dict(result: UnitsDiscovered) -> UnitsDiscoveredJson:
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


def _added(one: Added, axes: Axes) -> LackOfUnitJson:
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
