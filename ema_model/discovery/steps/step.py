"""A step of a discovery: its fit, its rung of the ladder, and the effects that the model has by then."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ema_model.discovery.candidates.refit import Trial
from ema_model.discovery.result import Added, Change, Rung, StoodIn
from ema_model.estimation import Calibration
from ema_model.estimation.model_fit import Data, Fit, floor_ratio, holdout_fit, ratio_by_recording, rms_by_signal

_MOVED = 1.5  # σ that a parameter comes back by, when it had been standing in for an effect


@dataclass(frozen=True, eq=False)
class Step:
    """A model on the way: its fit, its rung of the ladder, and the effects that were added so far."""

    fit: Fit
    rung: Rung
    added: tuple[Added, ...]
    settled_from: Step | None = None  # the same before its fit was settled, or its errors were told in other floors


def change_of(trial: Trial, parameter: str) -> Change:
    """What a step that adds this changes; parameter: the path of the one that it stands for."""
    if trial.faults:
        return Change("fault", trial.faults)
    name = trial.candidate.name
    if parameter:
        return Change("parameter", (parameter,))
    orders = tuple(values["order"] for key, values in trial.effects.items() if key != name and "order" in values)
    return Change("effect", (name,), orders)


def rung_of(change: Change, found: Fit, data: Data, held: Data | None) -> Rung:
    """A fit's errors, with those of what was held out."""
    shown = found.calibration.signals
    ratio, rms = floor_ratio(data, found.plant, shown), rms_by_signal(data, found.plant, shown)
    each = ratio_by_recording(data, found.plant, shown)
    unseen, unseen_rms, unseen_each = (None, {}, {}) if held is None else holdout_fit(held, found)
    return Rung(change, ratio, unseen, rms, unseen_rms, shown, each, unseen_each)


def stood_in(before: Fit, after: Fit) -> tuple[StoodIn, ...]:
    """Parameters that came back toward the file's value."""
    moved = []
    for path, one in before.calibration.parameters.items():
        now = after.calibration.parameters[path]
        if not path.startswith("effects.") and abs(one.z) - abs(now.z) > _MOVED:
            moved.append(StoodIn(path, one.z, now.z))
    return tuple(moved)


def refreshed(one: Added, calibration: Calibration) -> Added:
    """With the values of a calibration."""
    path = f"effects.{one.key}."
    fitted = {name.removeprefix(path): value for name, value in calibration.parameters.items() if name.startswith(path)}
    settings = calibration.actuator.effects[one.key]
    chosen = {name: value for name, value in settings.items() if name not in fitted}
    return replace(one, parameters=fitted, chosen=chosen)
