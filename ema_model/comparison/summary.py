"""A comparison in plain numbers, as `emaviz compare --json` writes it: what each field means, and where it is from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, TypedDict, TypeVar, cast

import numpy as np
from msgspec import Meta

from ema_model.actuator.naming import on_axes
from ema_model.comparison.events import Event
from ema_model.comparison.free_simulation import Simulated, without
from ema_model.comparison.result import COMPARISON_VERDICTS, Compared, Comparison, Region, SignalError
from ema_model.estimation import Calibrated, Calibration
from ema_model.estimation.calibrate import product_in_words
from ema_model.quantities.axes import Axes
from ema_model.quantities.numbers import IntervalJson
from ema_model.quantities.signals import SIGNALS
from ema_model.recordings.health.card import HealthJson

_Value = TypeVar("_Value")


class SignalErrorJson(TypedDict):
    """How far the model is from one signal, in the unit that ends the signal's name."""

    rmse: Annotated[float | None, Meta(description="root mean square of measurement − model; null: it diverges")]
    nrmse: Annotated[float | None, Meta(description="rmse over the range of the measured signal; null: it is constant")]
    noise_floor: Annotated[
        float | None, Meta(description="rms that a perfect model would leave: noise and model floor")
    ]
    rmse_initial: Annotated[float | None, Meta(description="rmse before the calibration, with the file's parameters")]
    mean_absolute: Annotated[float | None, Meta(description="mean of |measurement − model|")]
    informative: Annotated[
        bool, Meta(description="false: the signal is constant, or no larger than its floor, and tells nothing")
    ]


class SimulatedJson(TypedDict):
    """How far the model is from one signal when it runs freely from the recordings' first state on."""

    rmse: Annotated[float | None, Meta(description="rms error over all fitted recordings; null: see reason")]
    mae: Annotated[float | None, Meta(description="mean absolute error, likewise")]
    percent_of_range: Annotated[float | None, Meta(description="rmse, % of the measured signal's range")]
    reason: Annotated[str, Meta(description="why there is no number; empty where there is one")]
    holdout_rmse: Annotated[float | None, Meta(description="rmse of recordings that were not fitted; null: none")]
    holdout_mae: Annotated[float | None, Meta(description="mae of the same")]
    holdout_percent_of_range: Annotated[float | None, Meta(description="percent_of_range of the same")]
    holdout_reason: Annotated[str, Meta(description="why there is no number of those that were held out")]
    holdout_rmse_at_fitted_offset: Annotated[
        float | None,
        Meta(description="holdout_rmse in open loop with the fitted recordings' offset, not with their own"),
    ]
    unit: Annotated[str, Meta(description="of rmse and mae")]


class ParameterJson(TypedDict):
    """A calibrated parameter, in its `unit`."""

    value: Annotated[float, Meta(description="what was found")]
    initial: Annotated[float, Meta(description="what the actuator's file says")]
    interval90: Annotated[
        IntervalJson | None, Meta(description="the ends of the 90 % interval about value; null: see from_file")
    ]
    from_file: Annotated[bool, Meta(description="whether the recordings tell nothing beyond the file's tolerance")]
    unit: Annotated[str, Meta(description="of value, initial and interval90; empty for a ratio")]
    z: Annotated[float, Meta(description="value − initial, in σ of the file's tolerance")]
    at_bound: Annotated[bool, Meta(description="whether the fit ended at the end of what is allowed")]


class CombinationJson(TypedDict):
    """Parameters that are known only together, as the product of their powers."""

    members: Annotated[dict[str, int], Meta(description="powers by the names in the actuator's file")]
    combination: Annotated[str, Meta(description="the product in words")]
    value: Annotated[float, Meta(description="of the product, in SI units")]
    interval90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about value")]


class CalibrationJson(TypedDict):
    """The fit of the actuator's parameters within their tolerances."""

    converged: Annotated[bool, Meta(description="whether several starts end in the same minimum")]
    evaluations: Annotated[int, Meta(description="how many times the recordings were simulated")]
    parameters: Annotated[
        dict[str, ParameterJson], Meta(description="by the names in the actuator's file, section.name, and k1 … k8")
    ]
    starts: Annotated[
        dict[str, ParameterJson],
        Meta(
            description="of the recordings: turned N is the motor's offset at the start, faster N its speed's, play N "
            "where in the backlash it was, lag N by how much later than the positions the current was recorded"
        ),
    ]
    outside_tolerance: Annotated[list[str], Meta(description="parameters that end at the edge of their tolerance")]
    confounded: Annotated[list[list[str]], Meta(description="pairs of parameters that are known only together")]


class ExplanationJson(TypedDict):
    """How much of a residual one variable tells ahead, times a modulator."""

    variable: Annotated[str, Meta(description="motor_angle, user_position, motor_speed, acceleration, current, …")]
    modulator: Annotated[str, Meta(description="what the curve is multiplied by: 1, current or sign_speed")]
    r2: Annotated[
        float | None, Meta(description="share of the residual's power as it is, cross-validated; shares overlap")
    ]
    significant: Annotated[bool, Meta(description="whether noise alone would seldom show as much")]
    signal: Annotated[str, Meta(description="whose residual it is")]
    sentence: Annotated[str, Meta(description="the same in words")]


class OrderJson(TypedDict):
    """A part of the primary residual that repeats with the motor: amplitude · sin(order · θ + phase)."""

    order: Annotated[float, Meta(description="periods per revolution; rad/m where the motor's axis is linear")]
    amplitude: Annotated[float, Meta(description="in the primary signal's unit")]
    phase_rad: Annotated[float, Meta(description="rad")]


_Range = TypedDict(
    "_Range",
    {
        "from": Annotated[float, Meta(description="where the range begins, in the variable's SI unit")],
        "to": Annotated[float, Meta(description="where it ends, likewise")],
    },
)


class RegionJson(_Range):
    """A range of a variable in which the model fails most."""

    signal: Annotated[str, Meta(description="whose residual it is")]
    variable: Annotated[str, Meta(description="what the range is of: motor_speed, time, …")]
    rmse: Annotated[float | None, Meta(description="of the residual there, in the signal's unit")]
    mean: Annotated[float | None, Meta(description="of the residual there, measurement − model, in the signal's unit")]
    sentence: Annotated[str, Meta(description="the same in words")]


class EventJson(TypedDict):
    """A step of a residual at one moment of a recording."""

    recording: Annotated[str, Meta(description="its name")]
    time_s: Annotated[float, Meta(description="s, as recorded")]
    signal: Annotated[str, Meta(description="whose residual it is")]
    change: Annotated[float, Meta(description="after less before, in the signal's unit")]
    by_direction: Annotated[bool, Meta(description="whether it turns over with the direction of motion, as friction")]
    share: Annotated[float, Meta(description="0 … 1, of what the signal's residual has beyond its floor")]
    sentence: Annotated[str, Meta(description="the same in words")]


class HeldOutJson(TypedDict):
    """One recording beside the model."""

    name: Annotated[str, Meta(description="the file's name without its ending, #N for the run N of a file")]
    signals: Annotated[dict[str, SignalErrorJson], Meta(description="its errors, by signal")]


class ComparedJson(HeldOutJson):
    """One fitted recording beside the model."""

    notes: Annotated[list[str], Meta(description="what reading it found and did")]
    health: Annotated[HealthJson, Meta(description="what its own numbers say of its quality")]


class ComparisonJson(TypedDict):
    """Where the model fails beside the recordings of one actuator."""

    verdict: Annotated[str, Meta(description=f"one of {', '.join(COMPARISON_VERDICTS)}")]
    adequate: Annotated[bool, Meta(description="whether what is left may be noise and the model's own floor")]
    over_floor: Annotated[
        float | None, Meta(description="rms error pooled over signals, in units of the floor; 1 is the floor")
    ]
    floor_band: Annotated[list[float], Meta(description="between which over_floor of nine of ten true models lies")]
    sentences: Annotated[list[str], Meta(description="the answer in words, the first one first")]
    warnings: Annotated[list[str], Meta(description="what the answer must be read with")]
    signals: Annotated[dict[str, SignalErrorJson], Meta(description="errors over all fitted recordings, by signal")]
    primary: Annotated[str, Meta(description="the signal whose residual is explained")]
    calibration: Annotated[CalibrationJson | None, Meta(description="null where none was asked for")]
    identifiable: Annotated[list[CombinationJson], Meta(description="what the recordings tell only together")]
    explained_by: Annotated[list[ExplanationJson], Meta(description="what goes with the primary residual, best first")]
    orders: Annotated[list[OrderJson], Meta(description="of the primary residual, strongest first; significant ones")]
    worst_regions: Annotated[list[RegionJson], Meta(description="where the model fails most, worst first")]
    events: Annotated[list[EventJson], Meta(description="what happened at one moment")]
    simulation: Annotated[
        dict[str, SimulatedJson],
        Meta(description="of the model running freely, driven by the command, or in open loop; by signal"),
    ]
    recordings: Annotated[list[ComparedJson], Meta(description="those that were fitted, one by one")]
    holdout: Annotated[list[HeldOutJson], Meta(description="those that were not fitted, beside the calibrated model")]


def as_dict(comparison: Comparison) -> ComparisonJson:
    """Everything but the series, in numbers and texts that JSON can hold; unknown numbers are None."""
    document: ComparisonJson = {
        "verdict": comparison.verdict,
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
        "identifiable": combinations(comparison.calibration, comparison.actuator.axes),
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
        "worst_regions": [_region(one) for one in comparison.worst_regions],
        "events": [event_dict(one) for one in comparison.events],
        "simulation": simulation_dict(comparison.simulation),
        "recordings": [_compared(one) for one in comparison.recordings],
        "holdout": [{"name": one.name, "signals": _errors(one)} for one in comparison.holdout],
    }
    return plain(document)


def _region(one: Region) -> RegionJson:
    return {
        "signal": one.signal,
        "variable": one.variable,
        "from": one.low,
        "to": one.high,
        "rmse": one.rmse,
        "mean": one.mean,
        "sentence": one.sentence,
    }


def _compared(one: Compared) -> ComparedJson:
    return {
        "name": one.name,
        "notes": list(one.measurement.notes),
        "health": one.health.as_dict(),
        "signals": _errors(one),
    }


def _errors(one: Compared) -> dict[str, SignalErrorJson]:
    return {name: _error(error) for name, error in one.errors.items()}


def event_dict(one: Event) -> EventJson:
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


def simulation_dict(simulation: Mapping[str, Simulated]) -> dict[str, SimulatedJson]:
    """The free simulation's errors by signal; numbers that are not known are NaN."""
    found: dict[str, SimulatedJson] = {}
    for name, one in simulation.items():
        held = one.holdout or without("")
        found[name] = {
            "rmse": one.fitted.rmse,
            "mae": one.fitted.mae,
            "percent_of_range": one.fitted.percent_of_range,
            "reason": one.fitted.reason,
            "holdout_rmse": held.rmse,
            "holdout_mae": held.mae,
            "holdout_percent_of_range": held.percent_of_range,
            "holdout_reason": held.reason,
            "holdout_rmse_at_fitted_offset": (one.at_fitted_offset or without("")).rmse,
            "unit": SIGNALS[name].unit,
        }
    return found


def _error(error: SignalError) -> SignalErrorJson:
    return {
        "rmse": error.rmse,
        "nrmse": error.nrmse,
        "noise_floor": error.noise_floor,
        "rmse_initial": error.rmse_initial,
        "mean_absolute": error.mean_absolute,
        "informative": not error.silent,
    }


def calibration_dict(calibration: Calibration, axes: Axes) -> CalibrationJson:
    """A calibration's parameters by the names in files."""
    return {
        "converged": calibration.converged,
        "evaluations": calibration.evaluations,
        "parameters": {on_axes(name, axes).path: parameter_dict(one) for name, one in calibration.parameters.items()},
        "starts": {name: parameter_dict(one) for name, one in calibration.starts.items()},
        "outside_tolerance": [on_axes(name, axes).path for name in calibration.outside_tolerance],
        "confounded": [[on_axes(a, axes).path, on_axes(b, axes).path] for a, b in calibration.confounded],
    }


def combinations(calibration: Calibration | None, axes: Axes) -> list[CombinationJson]:
    """What a calibration knows only together, by the names in files."""
    return [
        {
            "members": {on_axes(name, axes).path: power for name, power in one.powers.items()},
            "combination": product_in_words(one, axes),
            "value": one.value,
            "interval90": list(one.interval90),
        }
        for one in (() if calibration is None else calibration.identifiable)
    ]


def parameter_dict(one: Calibrated) -> ParameterJson:
    """One calibrated parameter."""
    return {
        "value": one.value,
        "initial": one.initial,
        "interval90": None if one.from_file else list(one.interval90),
        "from_file": one.from_file,
        "unit": one.unit,
        "z": one.z,
        "at_bound": one.at_bound,
    }


def plain(value: _Value) -> _Value:
    """The value in types that JSON has; numbers that are not finite are None."""
    return cast(_Value, _plain(value))


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value
