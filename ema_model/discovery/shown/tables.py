"""A discovery in numbers: what was added, the ladder, each recording, the candidates."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ema_model.actuator.naming import on_axes
from ema_model.discovery.result import Added, Candidate, Discovery
from ema_model.discovery.shown.labels import effect_title, rung_title, settings
from ema_model.effects import find
from ema_model.effects.effect import FAMILIES
from ema_model.quantities.numbers import number
from ema_model.quantities.shown import of_signal
from ema_model.text import Facts, Table

_DIVERGED = 1e3  # times what was predicted, by which a refit is worse than the model without the effect


def added(found: Discovery) -> Iterator[Facts]:
    """Each effect with its parameters, also where it is a base parameter's value."""
    for one in (*found.effects, *found.freed):
        effect = find(one.name)
        lines = [f"it belongs to {FAMILIES[effect.family]}"] if effect.family == "drive" else []
        yield Facts(_parameters(found, one), f"{effect.title}: {effect.equation}", lines)


def _parameters(found: Discovery, one: Added) -> dict[str, str]:
    names = {name: on_axes(f"effects.{one.key}.{name}", found.actuator.axes).name for name in one.parameters}
    return {names.get(name, name): told for name, told in settings(found, one).items()}


def ladder(found: Discovery) -> Table:
    """Errors in floors; in the signals' units where the floor is not to be believed."""
    if not found.floor_believable:
        return ladder_by_signal(found)
    errors = [[_three(one.rmse), _three(one.holdout_rmse)] for one in found.ladder]
    return _steps(found, ("fitted", "held out"), errors, "(1 is the floor)")


def ladder_by_signal(found: Discovery) -> Table:
    """What is left of each signal after each step, in its unit."""
    shown = {
        name: of_signal(name, found.actuator.axes).scaled([one.signals[name] for one in found.ladder])
        for name in found.ladder[0].signals
    }
    errors = [[one.text(rung.signals[name]) for name, one in shown.items()] for rung in found.ladder]
    return _steps(found, [one.title for one in shown.values()], errors, "(rms of what was fitted)")


def _steps(found: Discovery, heads: Sequence[str], errors: Sequence[list[str]], unit: str) -> Table:
    labels = [rung_title(one.change, found.actuator.axes) for one in found.ladder]
    return Table(tuple(heads), [[label, *one] for label, one in zip(labels, errors)], "error ladder", unit=unit)


def per_recording(found: Discovery) -> Table | None:
    """The error of each recording, fitted or held out, on the first and the last step; None where there is but one."""
    first, last = found.ladder[0], found.ladder[-1]
    rows = [[name, number(first.recordings[name]), number(error)] for name, error in last.recordings.items()]
    held = [
        [name, number(first.holdout_recordings[name]), number(error)] for name, error in last.holdout_recordings.items()
    ]
    if len(rows) + len(held) < 2:
        return None
    remarks = [*([""] * len(rows)), *(["held out"] * len(held))]
    return Table(("calibrated", "last step"), [*rows, *held], "recording", remarks, "(error over the floor)")


def candidates(found: Discovery) -> Table | None:
    """What each effect or fault alone would take away from χ²; None where none was scored."""
    if not found.candidates:
        return None
    rows = [
        [
            effect_title(one.name),
            "–" if one.untestable_reason else f"{one.predicted_drop:.0f}",
            _refitted(one),
        ]
        for one in found.ranked
    ]
    remarks = [one.untestable_reason or "" for one in found.ranked]
    return Table(("predicted", "refitted"), rows, "candidates", remarks, "(fall of χ²)")


def _refitted(one: Candidate) -> str:
    """A refit that ends at far more than it could ever take away has diverged; its number says nothing."""
    if one.refitted_drop is None:
        return ""
    if not -_DIVERGED * max(one.predicted_drop, 1.0) < one.refitted_drop < math.inf:
        return "refit diverged"
    return f"{one.refitted_drop:.0f}".replace("-", "−")


def _three(rmse: float | None) -> str:
    return "" if rmse is None else f"{rmse:.3f}"
