"""A discovery in plain numbers, as `emaviz discover --json` writes it: what each field means, and where it is from."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, NotRequired, TypedDict

import numpy as np
from msgspec import Meta

from ema_model.actuator.naming import on_axes
from ema_model.comparison.summary import (
    CalibrationJson,
    EventJson,
    ParameterJson,
    calibration_dict,
    event_dict,
    parameter_dict,
    plain,
)
from ema_model.discovery.observed.controller import ControllerSeen
from ema_model.discovery.result import VERDICTS, Added, Candidate, Discovery, Experiment, Rung
from ema_model.discovery.shown.labels import rung_label
from ema_model.discovery.shown.sentences import masked
from ema_model.effects import find
from ema_model.faults import BY_NAME
from ema_model.quantities.axes import Axes
from ema_model.quantities.interval import IntervalJson

_FAULT = "fault"  # in place of the family of a candidate that is one
_RMSE = "rms error pooled over signals, in units of the floor; 1 is the floor"


class EffectParameterJson(TypedDict):
    """A parameter of an added effect, in its `unit`; one that was chosen, as a whole order, was not fitted."""

    value: Annotated[float, Meta(description="what was found")]
    interval90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about value")]
    unit: Annotated[str, Meta(description="of value, initial and interval90; empty for a ratio")]
    initial: NotRequired[Annotated[float, Meta(description="what the fit began with; of a fitted one")]]
    z: NotRequired[Annotated[float, Meta(description="value − initial, in σ of its tolerance; of a fitted one")]]
    at_bound: NotRequired[Annotated[bool, Meta(description="whether the fit ended at the end of what is allowed")]]


class AddedJson(TypedDict):
    """An effect that was added to the model."""

    name: Annotated[str, Meta(description="as `emaviz effects` lists it")]
    family: Annotated[str, Meta(description="mechanics, electrics, sensor or drive")]
    parameters: Annotated[dict[str, EffectParameterJson], Meta(description="by their names in the actuator's file")]
    rmse_before: Annotated[float | None, Meta(description=f"without it: {_RMSE}")]
    rmse_after: Annotated[float | None, Meta(description="with it, likewise")]
    holdout_rmse_before: Annotated[float | None, Meta(description="of what was not fitted, without it; null: nothing")]
    holdout_rmse_after: Annotated[float | None, Meta(description="of what was not fitted, with it; null: nothing")]
    same_as: Annotated[list[str], Meta(description="effects and faults that these recordings cannot tell from it")]
    supported_by: Annotated[list[str], Meta(description="the models that bear it out: closed_loop, inverse_dynamics")]


class RungJson(TypedDict):
    """One step of the error ladder."""

    label: Annotated[str, Meta(description="what was changed, in words")]
    kind: Annotated[
        str,
        Meta(description="calibrated, without_controller, fault, effect, parameter (freed), removed or replaced"),
    ]
    names: Annotated[list[str], Meta(description="of the effects, faults or parameters")]
    orders: Annotated[list[float], Meta(description="of a periodic effect that was there at others, per revolution")]
    rmse: Annotated[float | None, Meta(description=f"{_RMSE}; null: the floor is not to be believed")]
    holdout_rmse: Annotated[float | None, Meta(description="the same of what was not fitted; null: nothing")]
    signals: Annotated[dict[str, float | None], Meta(description="rms error by signal, in its unit")]
    holdout_signals: Annotated[dict[str, float | None], Meta(description="the same of what was not fitted")]
    recordings: Annotated[dict[str, float | None], Meta(description="rmse of each fitted recording, in floors")]
    holdout_recordings: Annotated[dict[str, float | None], Meta(description="the same of what was not fitted")]


class CandidateJson(TypedDict):
    """An effect, or a fault, that might be missing."""

    name: Annotated[str, Meta(description="of the effect, or k1 … k8")]
    family: Annotated[str, Meta(description="mechanics, electrics, sensor, drive, or fault")]
    predicted_drop: Annotated[float | None, Meta(description="of χ², before any refit")]
    tested: Annotated[bool, Meta(description="whether it was refitted")]
    refitted_drop: Annotated[float | None, Meta(description="of χ², by the refit; null: it was not refitted")]
    settings: Annotated[dict[str, float | None], Meta(description="its best settings, by the names in files")]
    untestable_reason: Annotated[str, Meta(description="why these recordings cannot show it; empty where they can")]


class UnknownJson(TypedDict):
    """What the last model leaves, as a curve of one variable times a modulator."""

    variable: Annotated[str, Meta(description="motor_angle, user_position, motor_speed, acceleration, current, …")]
    modulator: Annotated[str, Meta(description="what the curve is multiplied by: 1, current or sign_speed")]
    r2: Annotated[float | None, Meta(description="share of the residual's power beyond the floor, cross-validated")]
    curve: Annotated[
        list[list[float | None]],
        Meta(description="rows of the variable, the mean residual there and its standard error, in SI units"),
    ]
    added: Annotated[AddedJson | None, Meta(description="the torque curve that stands for it in the model, if any")]


class RepeatabilityJson(TypedDict):
    """The two recordings of one command that are furthest apart."""

    recordings: Annotated[list[str], Meta(description="their names")]
    over_floor: Annotated[float | None, Meta(description="rms of their difference over √2, in floors")]
    signals: Annotated[dict[str, float | None], Meta(description="the same by signal, in its unit")]


class RemainingJson(TypedDict):
    """What the last model leaves."""

    rmse: Annotated[float | None, Meta(description=f"{_RMSE}; null: the floor is not to be believed")]
    at_floor: Annotated[bool, Meta(description="whether it may be noise and the model's own floor")]


class ExperimentJson(TypedDict):
    """A test to do next."""

    command: Annotated[str, Meta(description="as of `emaviz simulate --command`")]
    settings: Annotated[dict[str, float], Meta(description="of the command, as of --set, and duration_s, s")]
    load: Annotated[float, Meta(description="N·m at the user (N on a linear axis), against positive motion")]
    add_signal: Annotated[str | None, Meta(description="a signal to record as well")]
    separates: Annotated[list[str], Meta(description="the two effects that it tells apart")]
    expected_chi2: Annotated[float | None, Meta(description="by which the wrong one of them would fit worse")]


class GainJson(TypedDict):
    """A gain of the controller, in the unit that ends its name."""

    file: Annotated[float, Meta(description="what the actuator's file says")]
    seen: Annotated[float, Meta(description="what the drive's current tells")]
    interval90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about seen")]
    differs: Annotated[bool, Meta(description="whether it is another than the file's, for sure and by much")]


class ControllerSeenJson(TypedDict):
    """The drive's controller, by its current, where it is not the file's."""

    gains: Annotated[dict[str, GainJson], Meta(description="by their names in the actuator's file")]
    delay_s: Annotated[float, Meta(description="s, by which it answers later than the file's controller")]
    left_by_file: Annotated[float, Meta(description="share of the current's rms that the file's controller misses")]
    left: Annotated[float, Meta(description="the same with the gains and the delay that suit best")]
    same_form: Annotated[bool, Meta(description="whether the law of the file's controller tells the current at all")]


class TransmissionSeenJson(TypedDict):
    """By how much the user's position leaves gear ratio × motor's position."""

    error: Annotated[float, Meta(description="rms at the user, rad (m on a linear axis)")]
    noise: Annotated[float, Meta(description="rms that the two sensors' noise makes, likewise")]
    cause: Annotated[str, Meta(description="acceleration, bandwidth, direction, position; empty: not known")]
    period: Annotated[float | None, Meta(description="at the motor, rad or m, where it repeats with the position")]
    amplitude: Annotated[float | None, Meta(description="of what repeats, at the user, rad or m")]
    frequency_Hz: Annotated[float | None, Meta(description="Hz, of the user on a shaft that gives, the motor held")]


class DisagreementJson(TypedDict):
    """A held-out recording that contradicts the fitted ones."""

    recording: Annotated[str, Meta(description="its name")]
    signal: Annotated[str | None, Meta(description="whose reading explains it")]
    how: Annotated[str, Meta(description="sign, zero, unit, actuator or unknown")]
    sentence: Annotated[str, Meta(description="the same in words")]
    before: Annotated[float | None, Meta(description="its rms error, in floors")]
    after: Annotated[float | None, Meta(description="the same once that is put right")]


class SavedActuatorJson(TypedDict):
    """The improved model, written as an actuator file and simulated again from there."""

    file: Annotated[str, Meta(description="as given with --save-actuator")]
    verified_rmse: Annotated[float | None, Meta(description=f"of the saved model: {_RMSE}")]
    verified_holdout_rmse: Annotated[float | None, Meta(description="the same of what was not fitted; null: nothing")]


class DiscoveryJson(TypedDict):
    """Which physical effects the model of one actuator lacks."""

    verdict: Annotated[str, Meta(description=f"one of {', '.join(VERDICTS)}")]
    calibration: Annotated[CalibrationJson, Meta(description="of the last model")]
    effects: Annotated[list[AddedJson], Meta(description="that are missing, in the order in which they were added")]
    ladder: Annotated[list[RungJson], Meta(description="the error after each change of the model")]
    candidates: Annotated[list[CandidateJson], Meta(description="all effects of the first search, best first")]
    faults: Annotated[dict[str, ParameterJson], Meta(description="k1 … k8 that the last model has, 0 … 1")]
    parameters_outside_tolerance: Annotated[list[str], Meta(description="section.name, beyond their tolerance")]
    unknown: Annotated[UnknownJson | None, Meta(description="what no effect explains; null: nothing that is told")]
    floor_believable: Annotated[bool, Meta(description="whether errors may be counted in floors")]
    floor_band: Annotated[list[float], Meta(description="between which rmse of nine of ten true models lies")]
    repeatability: Annotated[RepeatabilityJson | None, Meta(description="null: no command was recorded twice")]
    remaining: Annotated[RemainingJson, Meta(description="the error of the last model")]
    not_claimed: Annotated[dict[str, str], Meta(description="effects that the data would pay for, and why not")]
    next_experiment: Annotated[ExperimentJson | None, Meta(description="that tells the rivals apart; null: none")]
    controller_mismatch: Annotated[bool, Meta(description="whether the drive's controller is not the file's")]
    controller_seen: Annotated[ControllerSeenJson | None, Meta(description="what it is instead")]
    transmission_seen: Annotated[TransmissionSeenJson | None, Meta(description="where it is not the file's")]
    disagreements: Annotated[list[DisagreementJson], Meta(description="held-out recordings at odds with the fitted")]
    events: Annotated[list[EventJson], Meta(description="what happened at one moment")]
    warnings: Annotated[list[str], Meta(description="what the answer must be read with")]
    saved_actuator: NotRequired[Annotated[SavedActuatorJson, Meta(description="with --save-actuator")]]


def as_dict(found: Discovery) -> DiscoveryJson:
    """Everything but the series, in numbers and texts that JSON can hold; unknown numbers are None."""
    axes = found.actuator.axes
    unknown, seen = found.unknown, found.transmission_seen
    twice, is_believable = found.repeated, found.floor_believable
    document: DiscoveryJson = {
        "verdict": found.verdict,
        "calibration": calibration_dict(found.calibration, axes),
        "effects": [_added(one, axes) for one in found.effects],
        "ladder": [_rung(rung, axes, is_believable) for rung in found.ladder],
        "candidates": [_candidate(one, axes) for one in found.candidates],
        "faults": {name: parameter_dict(one) for name, one in found.faults.items()},
        "parameters_outside_tolerance": [on_axes(name, axes).path for name in found.parameters_outside_tolerance],
        "unknown": None
        if unknown is None
        else {
            "variable": unknown.variable,
            "modulator": unknown.modulator,
            "r2": unknown.r2,
            "curve": np.column_stack([unknown.centres, unknown.curve, unknown.error]).tolist(),
            "added": None if found.curve is None else _added(found.curve, axes),
        },
        "floor_believable": is_believable,
        "floor_band": list(found.floor_band),
        "repeatability": None
        if twice is None
        else {
            "recordings": list(twice.recordings),
            "over_floor": twice.apart,
            "signals": {axes.signal(name): value for name, value in twice.signals.items()},
        },
        "remaining": {"rmse": found.ladder[-1].rmse if is_believable else None, "at_floor": found.at_floor},
        "not_claimed": dict(found.not_claimed),
        "next_experiment": _experiment(found.next_experiment),
        "controller_mismatch": found.controller_seen is not None,
        "controller_seen": _seen(found.controller_seen, axes),
        "transmission_seen": None if seen is None else TransmissionSeenJson(**asdict(seen)),
        "disagreements": [
            {
                "recording": one.recording,
                "signal": None if one.signal is None else axes.signal(one.signal),
                "how": one.how,
                "sentence": one.sentence,
                "before": one.before,
                "after": one.after,
            }
            for one in found.disagreements
        ],
        "events": [event_dict(one) for one in found.events],
        "warnings": [*found.warnings, *masked(found.effects, found.actuator.axes)],
    }
    return plain(document)


def _candidate(one: Candidate, axes: Axes) -> CandidateJson:
    is_fault = one.name in BY_NAME
    names = {name: name if is_fault else on_axes(f"effects.{one.name}.{name}", axes).name for name in one.settings}
    return {
        "name": one.name,
        "family": _FAULT if is_fault else find(one.name).family,
        "predicted_drop": one.predicted_drop,
        "tested": one.refitted_drop is not None,
        "refitted_drop": one.refitted_drop,
        "settings": {names[name]: value for name, value in one.settings.items()},
        "untestable_reason": one.untestable_reason,
    }


def _rung(one: Rung, axes: Axes, is_believable: bool) -> RungJson:
    change = one.change
    names = [on_axes(name, axes).path for name in change.names] if change.kind == "parameter" else list(change.names)
    return {
        "label": rung_label(change, axes),
        "kind": change.kind,
        "names": names,
        "orders": list(change.orders),
        "rmse": one.rmse if is_believable else None,  # in floors
        "holdout_rmse": one.holdout_rmse if is_believable else None,
        "signals": dict(one.signals),
        "holdout_signals": dict(one.holdout_signals),
        "recordings": dict(one.recordings),
        "holdout_recordings": dict(one.holdout_recordings),
    }


def _seen(one: ControllerSeen | None, axes: Axes) -> ControllerSeenJson | None:
    if one is None:
        return None
    return {
        "gains": {
            on_axes(gain.path, axes).path: {
                "file": gain.file,
                "seen": gain.seen,
                "interval90": [gain.seen - gain.half, gain.seen + gain.half],
                "differs": gain.differs,
            }
            for gain in one.gains
        },
        "delay_s": one.delay_s,
        "left_by_file": one.left_by_file,
        "left": one.left,
        "same_form": one.holds,
    }


def _experiment(one: Experiment | None) -> ExperimentJson | None:
    if one is None:
        return None
    return {
        "command": one.command,
        "settings": {**one.settings, "duration_s": one.duration_s},
        "load": one.load_torque_Nm,
        "add_signal": one.add_signal,
        "separates": list(one.separates),
        "expected_chi2": one.expected_chi2,
    }


def _added(one: Added, axes: Axes) -> AddedJson:
    found: dict[str, EffectParameterJson] = {name: {**parameter_dict(its)} for name, its in one.parameters.items()}
    for name, value in one.chosen.items():
        found[name] = {"value": value, "interval90": [value, value], "unit": ""}
    return {
        "name": one.name,
        "family": find(one.name).family,
        "parameters": {on_axes(f"effects.{one.key}.{name}", axes).name: facts for name, facts in found.items()},
        "rmse_before": one.rmse_before,
        "rmse_after": one.rmse_after,
        "holdout_rmse_before": one.holdout_before,
        "holdout_rmse_after": one.holdout_after,
        "same_as": list(one.same_as),
        "supported_by": list(one.supported_by),
    }
