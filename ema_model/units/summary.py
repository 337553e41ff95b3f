"""The JSON form of what units differ in: what each field means, and where it is from."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, TypedDict

from msgspec import Meta

from ema_model.actuator.naming import on_axes
from ema_model.quantities.interval import IntervalJson
from ema_model.units.result import Difference, OfRecording, OfType, UnitsCompared
from ema_model.units.words import sentences


class DifferenceJson(TypedDict):
    """A parameter in which one unit is not as the others."""

    unit: Annotated[str, Meta(description="its name")]
    parameter: Annotated[str, Meta(description="section.name, as the actuator's file calls it")]
    same_as: Annotated[list[str], Meta(description="other parameters of the unit that would tell it as well")]
    change: Annotated[float, Meta(description="from what the others share, in the unit that ends the name")]
    interval90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about change")]
    share: Annotated[float | None, Meta(description="the change over what the others share; null: that is 0")]
    share_interval90: Annotated[IntervalJson | None, Meta(description="the ends of the 90 % interval about share")]
    evidence: Annotated[float, Meta(description="of −2 log likelihood, by which a shared value is worse")]
    held_out_evidence: Annotated[float | None, Meta(description="the same on what was not fitted; null: nothing was")]


class UnitParameterJson(TypedDict):
    """A parameter of one unit, as its own recordings tell it."""

    value: Annotated[float, Meta(description="in `unit`")]
    interval90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about value")]
    unit: Annotated[str, Meta(description="of measurement; empty for a ratio")]


class UnitJson(TypedDict):
    """One unit of the type."""

    name: Annotated[str, Meta(description="its folder, number or --unit name")]
    recordings: Annotated[list[str], Meta(description="names of those that were fitted")]
    holdout: Annotated[list[str], Meta(description="names of those that were not fitted")]
    error: Annotated[float, Meta(description="rms error of its own model pooled over signals, in floors")]
    parameters: Annotated[dict[str, UnitParameterJson], Meta(description="by section.name")]


_In = TypedDict("_In", {"in": Annotated[str, Meta(description="the unit of measurement: A, s or K")]})


class OfRecordingJson(_In):
    """In what one recording disagrees with the others of its unit."""

    unit: Annotated[str, Meta(description="the unit's name")]
    recording: Annotated[str, Meta(description="the recording's name")]
    quantity: Annotated[str, Meta(description="current_zero, current_delay or winding_temperature")]
    value: Annotated[float, Meta(description="by how much, in the unit that `in` says")]
    interval90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about value")]
    allowed_for: Annotated[
        bool, Meta(description="whether the fit allows for it; else the unit's differences are open")
    ]


class OfTypeJson(TypedDict):
    """A parameter of the type, in its `unit`."""

    mean: Annotated[float, Meta(description="over the units")]
    mean90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about mean")]
    scatter: Annotated[float, Meta(description="1 σ over units; 0 where all share the value")]
    sigma: Annotated[float, Meta(description="1 σ of a further unit: scatter, and what is not known of the mean")]
    unit: Annotated[str, Meta(description="of measurement; empty for a ratio")]
    told: Annotated[bool, Meta(description="whether the recordings tell it; else it is as the file says")]


class TransferJson(TypedDict):
    """Each unit's model on each unit's recordings; rows and columns are in the order of `units`."""

    signal: Annotated[str, Meta(description="that rmse and noise_floor are of, and whose unit they have")]
    rmse: Annotated[list[list[float]], Meta(description="rows: the model of, columns: the recordings of")]
    noise_floor: Annotated[list[float], Meta(description="rms that a perfect model would leave of the recordings of")]
    floors: Annotated[list[list[float]], Meta(description="the error of all signals in floors, as rmse is ordered")]


class NeedJson(TypedDict):
    """A parameter that a unit's recordings do not tell."""

    unit: Annotated[str, Meta(description="the unit's name")]
    parameter: Annotated[str, Meta(description="section.name")]
    like: Annotated[str | None, Meta(description="a recording of another unit that tells it there; null: none does")]


class UnitsComparedJson(TypedDict):
    """What units of one type differ in (with --by or --unit)."""

    sentences: Annotated[list[str], Meta(description="the answer in words, the first one first")]
    warnings: Annotated[list[str], Meta(description="what the answer must be read with")]
    units: Annotated[list[UnitJson], Meta(description="each as its own recordings tell it")]
    differences: Annotated[list[DifferenceJson], Meta(description="in which units are not as the others")]
    contradicted: Annotated[list[DifferenceJson], Meta(description="differences that held-out recordings contradict")]
    of_recordings: Annotated[list[OfRecordingJson], Meta(description="what is of one recording, and of no unit")]
    scattering: Annotated[list[str], Meta(description="parameters that scatter over all units, section.name")]
    type: Annotated[dict[str, OfTypeJson], Meta(description="what the units have in common, by section.name")]
    transfer: Annotated[TransferJson, Meta(description="which model suits which unit")]
    needed: Annotated[list[NeedJson], Meta(description="what the recordings do not tell, and which would")]


def as_dict(result: UnitsCompared) -> UnitsComparedJson:
    """Plain values only; parameters as the actuator's file calls them."""

    def shown(path: str) -> str:
        return on_axes(path, result.actuator.axes).path

    def difference(one: Difference) -> DifferenceJson:
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

    def alone(unit: int) -> dict[str, UnitParameterJson]:
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
        "of_recordings": [_of_recording(one) for one in result.of_recordings],
        "scattering": [shown(path) for path in result.scattering],
        "type": {shown(path): _of_type(one) for path, one in result.of_type.items()},
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


def _of_recording(one: OfRecording) -> OfRecordingJson:
    return {
        "unit": one.unit,
        "recording": one.recording,
        "quantity": one.quantity,
        "value": one.value,
        "interval90": list(one.value90),
        "in": one.in_unit,
        "allowed_for": one.allowed_for,
    }


def _of_type(one: OfType) -> OfTypeJson:
    return OfTypeJson(**{**asdict(one), "mean90": list(one.mean90)})
