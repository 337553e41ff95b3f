"""A calibration in words: whether it has converged, what it moved and how surely, what it cannot tell apart."""

from __future__ import annotations

from collections.abc import Collection

from ema_model.actuator.naming import on_axes
from ema_model.estimation.calibrate import Calibration
from ema_model.faults import NAMES
from ema_model.quantities.axes import Axes
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from ema_model.text import Severity, Table


def convergence(fit: Calibration) -> str:
    """'It has converged; χ² per value 1.02 (1 is the floor), 87 evaluations.'"""
    how = "It has converged" if fit.converged else "It has not converged: its values are not to be trusted"
    return f"{how}; χ² per value {number(fit.chi2_per_value)} (1 is the floor), {fit.evaluations} evaluations."


def calibration_table(fit: Calibration, axes: Axes, among: Collection[str] | None = None) -> Table | None:
    """What each parameter, or some, was in the file and is now, with its interval, and how many σ that is apart."""
    rows, remarks = [], []
    fitted = {path: one for path, one in fit.parameters.items() if among is None or path in among}
    for path, one in fitted.items():
        low, high = (number(edge, 4) for edge in one.interval90)
        moved = f"{round(one.z, 2) + 0.0:+.2f}".replace("-", "−")
        rows.append([_title(path, axes), number(one.initial, 4), number(one.value, 4), f"{low} … {high}", moved])
        remarks.append(f"{one.unit}{'  at its bound' if one.at_bound else ''}".strip())
    if not rows:
        return None
    state = "converged" if fit.converged else "NOT converged"
    severities: list[Severity | None] = ["bad" if one.at_bound else None for one in fitted.values()]
    head = ("file", "value", "90 % interval", "moved [σ]")
    return Table(head, rows, f"calibration {state}", remarks, severities=severities)


def warnings(fit: Calibration, axes: Axes) -> list[str]:
    """The parameters at their bounds, and those that are only known together."""
    found = [
        f"{_title(path, axes)} stands at the bound of its tolerance: the model wants more than the file allows."
        for path, one in fit.parameters.items()
        if one.at_bound
    ]
    return found + [
        f"{_title(a, axes)} and {in_sentence(_title(b, axes))} trade against each other here: "
        "only both together are known."
        for a, b in fit.confounded
    ]


def _title(path: str, axes: Axes) -> str:
    return path if path in NAMES else on_axes(path, axes).title
