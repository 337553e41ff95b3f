"""A run in numbers: currents, following error, rise time, and how far the monitor is from the plant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.sides import MOTOR, USER, Side
from ema_model.recordings import Measurement
from emaviz.figures.signal_charts import charts
from emaviz.text.html import Html, html, joined

_RISE = "rise time 10–90 %"


@dataclass(frozen=True)
class Metric:
    """A row of the table; `side`: whose axis it is of; `missing`: what is said where there is no number."""

    name: str
    unit: str
    side: Side | None = None
    prefix: str = ""
    missing: str = "diverged"


METRICS = (
    Metric("peak current", "A"),
    Metric("rms current", "A"),
    Metric("largest following error", "rad", USER, "m"),
    Metric("rms following error", "rad", USER, "m"),
    Metric(_RISE, "s", prefix="m", missing="not reached"),
    Metric("peak speed", "rad/s", MOTOR),
)


def metrics(run: Measurement, command: str) -> dict[str, float]:
    """The metrics of a run by name; only a step has a rise time, which is NaN where the user does not get that far."""
    current, user = run["current_A"], run["user_position_rad"]
    error = 1e3 * (run["command_rad"] - user)
    found = {
        "peak current": float(np.max(np.abs(current))),
        "rms current": _rms(current),
        "largest following error": float(np.max(np.abs(error))),
        "rms following error": _rms(error),
        "peak speed": float(np.max(np.abs(run["motor_speed_rad_s"]))),
    }
    return {**found, _RISE: 1e3 * rise_time_s(run)} if command == "step" else found


def rise_time_s(run: Measurement) -> float:
    """From 10 to 90 % of a step, s; NaN where the user does not get that far."""
    demand = run["command_rad"]
    low, high = float(run["user_position_rad"][0]), float(demand[-1])
    if high == low:
        return math.nan
    share = (run["user_position_rad"] - low) / (high - low)
    times = []
    for level in (0.1, 0.9):
        reached = np.flatnonzero(share >= level)
        if not len(reached):
            return math.nan
        i = max(int(reached[0]), 1)
        part = (level - share[i - 1]) / (share[i] - share[i - 1])
        times.append(run.time_s[i - 1] + part * (run.time_s[i] - run.time_s[i - 1]))
    return float(times[1] - times[0])


def differences(reference: Measurement, monitor: Measurement, axes: Axes = ROTARY) -> dict[str, tuple[float, str]]:
    """RMSE of monitor − reference for each chart: by its title, the number and its unit."""
    return {
        chart.title: (chart.difference_scale * _rms(monitor[chart.signal] - reference[chart.signal]),
                      chart.difference_unit)
        for chart in charts(axes)
    }  # fmt: skip


def table(
    runs: Mapping[str, Mapping[str, float]],
    errors: Mapping[str, Mapping[str, tuple[float, str]]],
    colours: list[str],
    axes: Axes = ROTARY,
) -> Html:
    """HTML: the metrics of each run, and below the differences of each pair of runs."""
    right = "text-align:right;font-weight:600"
    heads = joined(html('<th style="{};color:{}">{}</th>', right, colour, name) for name, colour in zip(runs, colours))
    rows = joined(
        html("<tr><td>{} [{}{}]</td>", metric.name, metric.prefix, axes.unit(metric.unit, metric.side))
        + joined(html('<td style="text-align:right">{}</td>', _shown(run, metric)) for run in runs.values())
        + html("</tr>")
        for metric in METRICS
        if any(metric.name in run for run in runs.values())
    )
    heads_below = joined(html('<th style="{}">{}</th>', right, name) for name in errors)
    first = next(iter(errors.values()))
    rows_below = joined(
        html("<tr><td>{} [{}]</td>", title, unit)
        + joined(
            html('<td style="text-align:right">{}</td>', _number(error[title][0], "diverged"))
            for error in errors.values()
        )
        + html("</tr>")
        for title, (_, unit) in first.items()
    )
    style = Html('style="width:100%;border-collapse:collapse;font-variant-numeric:tabular-nums;line-height:1.7"')
    return html(
        '<div style="padding:4px 12px;font-size:13px"><table {}><tr><th></th>{}</tr>{}</table>'
        '<div style="margin-top:14px;font-weight:600">RMSE over the whole run</div>'
        "<table {}><tr><th></th>{}</tr>{}</table></div>",
        style,
        heads,
        rows,
        style,
        heads_below,
        rows_below,
    )


def _rms(values: np.ndarray) -> float:
    largest = float(np.max(np.abs(values)))
    if not math.isfinite(largest) or largest == 0.0:
        return largest
    return largest * float(np.sqrt(np.mean(np.square(values / largest))))  # a diverged run's own squares overflow


def _shown(run: Mapping[str, float], metric: Metric) -> str:
    """A metric in a cell, or why there is no number; a run that lacks one stands beside a step that has it."""
    return _number(run[metric.name], metric.missing) if metric.name in run else "no step"


def _number(value: float, missing: str) -> str:
    return f"{value:.4g}" if math.isfinite(value) else missing
