"""A discovery in plain numbers, as `emaviz discover --json` writes it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from ema_model.actuator.naming import on_axes
from ema_model.comparison.summary import calibration_dict, event_dict, parameter_dict, plain
from ema_model.discovery.observed.controller import ControllerSeen
from ema_model.discovery.result import Added, Candidate, Discovery, Experiment, Rung
from ema_model.discovery.shown.labels import rung_label
from ema_model.discovery.shown.sentences import masked
from ema_model.effects import find
from ema_model.faults import BY_NAME
from ema_model.quantities.axes import Axes

_FAULT = "fault"  # in place of the family of a candidate that is one


def as_dict(found: Discovery) -> dict[str, Any]:
    """Everything but the series, in numbers and texts that JSON can hold; unknown numbers are None."""
    axes = found.actuator.axes
    unknown = found.unknown
    twice, is_believable = found.repeated, found.floor_believable
    return plain(
        {
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
            "transmission_seen": None if found.transmission_seen is None else asdict(found.transmission_seen),
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
    )


def _candidate(one: Candidate, axes: Axes) -> dict[str, Any]:
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


def _rung(one: Rung, axes: Axes, is_believable: bool) -> dict[str, Any]:
    change = one.change
    names = [on_axes(name, axes).path for name in change.names] if change.kind == "parameter" else list(change.names)
    return {
        "label": rung_label(change, axes),
        "kind": change.kind,
        "names": names,
        "orders": list(change.orders),
        "rmse": one.rmse if is_believable else None,  # in floors
        "holdout_rmse": one.holdout_rmse if is_believable else None,
        "signals": one.signals,
        "holdout_signals": one.holdout_signals,
        "recordings": one.recordings,
        "holdout_recordings": one.holdout_recordings,
    }


def _seen(one: ControllerSeen | None, axes: Axes) -> dict[str, Any] | None:
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


def _experiment(one: Experiment | None) -> dict[str, Any] | None:
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


def _added(one: Added, axes: Axes) -> dict[str, Any]:
    chosen = {name: {"value": value, "interval90": [value, value], "unit": ""} for name, value in one.chosen.items()}
    found = {name: parameter_dict(parameter) for name, parameter in one.parameters.items()} | chosen
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
