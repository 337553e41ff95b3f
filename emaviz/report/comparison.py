"""The report of a comparison: its sections in reading order, and the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ema_model.comparison.regions import Region, worst_moment
from ema_model.comparison.result import (
    FLOOR_NOTE,
    FREE_NOTE,
    Comparison,
    details,
    errors,
    errors_by_recording,
    free_simulation,
    held_out,
    of_floor,
    verdict,
)
from ema_model.estimation.calibrate import calibration_table, convergence, warnings
from ema_model.quantities.numbers import number
from ema_model.quantities.variables import VARIABLES, variable_title
from ema_model.recordings.health import MARKS, Health
from emaviz.figures import campaign, comparison
from emaviz.figures import comparison as comparison_figures
from emaviz.figures.comparison import time_ranges
from emaviz.report.html_document import (
    Figures,
    Section,
    blocks,
    bullets,
    escape,
    folded,
    link,
    page,
    pair,
    paragraph,
    table,
    with_remarks,
    write,
)
from emaviz.text.results import of_comparison


class Answer(Section[Comparison]):
    """The sentences, whether the model is adequate, and what to be warned of."""

    title = "The answer"
    anchor = "answer"

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Always there."""
        told = verdict(subject)
        first, *others = subject.sentences or (f"The model is {told}.",)
        return (
            f'<p><span class="verdict {of_comparison(subject)}">{escape(told)}</span></p>'
            + paragraph(first, "answer")
            + "".join(paragraph(sentence) for sentence in [*others, of_floor(subject)])
            + bullets(subject.warnings, "warning")
        )


# --- how far the model is from each signal, against the floor, before and after calibration ---------------------------


class ErrorsPerSignal(Section[Comparison]):
    """A table over all recordings, that of the free simulation, and one for each signal by recording."""

    title = "Errors"
    anchor = "errors"

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Always there."""
        parts = [with_remarks(errors(subject)), paragraph(FLOOR_NOTE, "small")]
        parts.append(blocks(free_simulation(subject.simulation, subject.actuator.axes), FREE_NOTE))
        for name in subject.signals:
            if (told := errors_by_recording(subject, name)) is not None:
                title = f"{comparison.quantity_of_signal(subject, name).title}, by recording"
                rows = with_remarks(told)
                parts.append(f"<h3>{escape(title)}</h3>{rows}" if name == subject.primary else folded(title, rows))
        return "".join(parts)


# --- how far the calibrated model is from recordings that were not fitted ---------------------------------------------


class HeldOut(Section[Comparison]):
    """Left out where all were fitted."""

    title = "Not fitted"
    anchor = "held-out"

    def body(self, subject: Comparison, figures: Figures) -> str:
        """A line for each."""
        return bullets(held_out(one) for one in subject.holdout)


# --- where the model fails most: each region in words, against its variable, and where it is in time ------------------

_STAYS = 8.0  # times the stay in the region is shown
_LEAST_BLOCKS = 400


class WorstRegions(Section[Comparison]):
    """A card for each region, worst first, with links to the full figures."""

    title = "Where it fails"
    anchor = "regions"

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Says so where no region stands out of the floor."""
        if not subject.worst_regions:
            return paragraph("No region stands out of the floor.")
        return "".join(_card(subject, figures, i, region) for i, region in enumerate(subject.worst_regions))


def _card(comparison: Comparison, figures: Figures, index: int, region: Region) -> str:
    recording, block = worst_moment(comparison.residuals, region)
    time_s = float(comparison.residuals.time_s[block])
    name = comparison.recordings[recording].name or f"recording {recording + 1}"
    variable = variable_title(region.variable)
    window = _around(comparison, region, recording, time_s)
    against = comparison_figures.residual_against(comparison, region.variable, region.signal, highlight=region)
    over_time = comparison_figures.residual_time(
        comparison, region.signal, recording, highlight=region, moment_s=time_s, window_s=window
    )
    links = (
        link(f"against-{region.variable}", f"{variable}: all of it")
        + " · "
        + link(f"recording-{recording + 1}", f"{name}, worst at {number(time_s, 4)} s")
    )
    return (
        f'<div class="region" id="region-{index + 1}"><h3>{index + 1}. {escape(region.sentence)}</h3>'
        + paragraph(details(comparison, region), "dim")
        + pair(figures.place(against, 300), figures.place(over_time, 300))
        + f'<p class="small">Seen in: {links}</p></div>'
    )


def _around(comparison: Comparison, region: Region, recording: int, time_s: float) -> tuple[float, float]:
    """A window of time about the worst moment in which the region's stay there can be seen, from–to, s."""
    time = comparison.recordings[recording].time_s
    first, last = float(time.min()), float(time.max())
    stays = [high - low for low, high in time_ranges(comparison, region, recording) if low <= time_s <= high]
    width = max(_STAYS * max(stays, default=0.0), _LEAST_BLOCKS * comparison.residuals.block_s)
    start = min(max(time_s - 0.5 * width, first), max(last - width, first))
    return start, min(start + width, last)


# --- what explains the residual ---------------------------------------------------------------------------------------
# What explains the residual: the ranking, the orders of the motor's turn, and the residual against each variable.

_FIRST = 4  # explanations are written out; the bars show all
_EXPLANATION_NOTE = (
    "A variable explains the residual as far as a curve of it, fitted to a part of the data, tells the rest ahead. "
    "Pale bars are what noise could have made."
)


class WhatExplains(Section[Comparison]):
    """All of the primary signal."""

    title = "What explains the residual"
    anchor = "explained"

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Without variables that are known there is nothing to tell."""
        known = [v for v in VARIABLES if np.any(np.isfinite(subject.residuals.variables.get(v, np.zeros(0))))]
        if not known:
            return ""
        told = [e for e in subject.explained_by if e.significant][:_FIRST]
        parts = [paragraph(e.sentence) for e in told] or [paragraph("No variable explains it beyond noise.")]
        # a row for each variable and the axis below
        tall = max(260, 100 + 44 * len({e.variable for e in subject.explained_by}))
        parts += [
            figures.place(comparison_figures.explained(subject), tall, "explained-by"),
            paragraph(_EXPLANATION_NOTE, "small"),
        ]
        if "motor_angle" in known and subject.actuator.axes.motor == "rotary":
            polar = figures.place(comparison_figures.residual_polar(subject), 400, "polar")
            parts.append(pair(polar, figures.place(comparison_figures.order_spectrum(subject), 400, "orders")))
            if subject.orders:
                parts.append(folded("The orders in numbers", _orders(subject)))
        order = list(dict.fromkeys(e.variable for e in subject.explained_by if e.variable in known))
        against = [
            figures.place(comparison_figures.residual_against(subject, variable), 340, f"against-{variable}")
            for variable in dict.fromkeys(order + known)
        ]
        return "".join(parts) + pair(*against)


def _orders(comparison: Comparison) -> str:
    largest = max(order.amplitude for order in comparison.orders)
    shown = comparison_figures.of_residual(comparison, comparison.primary, as_torque=True).scaled(largest)
    rows = [
        [f"{order.order}", shown.text(order.amplitude), f"{np.degrees(order.phase):.0f}°"]
        for order in comparison.orders[:20]
    ]
    return table(["Periods in each turn", "amplitude", "phase"], rows)


# --- each recording beside the model, and what is left over time ------------------------------------------------------


class Recordings(Section[Comparison]):
    """The primary signal of each; the others folded away."""

    title = "Recordings"
    anchor = "recordings"

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Always there."""
        return "".join(self._one(subject, figures, i) for i in range(len(subject.recordings)))

    def _one(self, comparison: Comparison, figures: Figures, index: int) -> str:
        one = comparison.recordings[index]
        first = comparison.primary if comparison.primary in one.measured else next(iter(one.measured))
        parts = [f'<h3 id="recording-{index + 1}">{index + 1}. {escape(one.name or "recording")}</h3>']
        parts.append(_figures(comparison, figures, first, index))
        for name in one.measured:
            if name != first:
                title = comparison_figures.quantity_of_signal(comparison, name).title
                parts.append(folded(title, _figures(comparison, figures, name, index)))
        return "".join(parts)


def _figures(comparison: Comparison, figures: Figures, signal: str, index: int) -> str:
    return figures.place(comparison_figures.overlay(comparison, signal, index), 360) + figures.place(
        comparison_figures.residual_time(comparison, signal, index), 300
    )


# --- what calibration moved, how surely, and what it warns of ---------------------------------------------------------


class CalibrationTable(Section[Comparison]):
    """Left out where nothing was calibrated."""

    title = "Calibration"
    anchor = "calibration"

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Convergence, figure, table, warnings."""
        fit = subject.calibration
        if fit is None:
            return ""
        parts = [paragraph(convergence(fit), "" if fit.converged else "bad")]
        if (told := calibration_table(fit, subject.actuator.axes)) is not None:
            parts.append(figures.place(campaign.calibration_scores(subject), 110 + 30 * len(told.rows), "scores"))
            parts.append(with_remarks(told))
        return "".join([*parts, bullets(warnings(fit, subject.actuator.axes), "warning")])


# --- what the recordings' own numbers say about sampling, sensors, signs and limits -----------------------------------


class DataHealth(Section[Comparison]):
    """Each recording's findings, warnings first, and what reading it did."""

    title = "Data health"
    anchor = "health"

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Always there."""
        parts = []
        for i, one in enumerate(subject.recordings):
            m = one.measurement
            size = f"{m.samples} samples" if m.is_map else f"{m.samples} samples, {m.duration_s:.4g} s"
            parts.append(f"<h3>{i + 1}. {escape(one.name or 'recording')}</h3>")
            parts.append(f'<p class="dim">{escape(size)}</p>{findings(one.health)}{bullets(m.notes, "small")}')
        return "".join(parts)


def findings(health: Health) -> str:
    """A line for each, with its mark."""
    items = [
        f'<li><span class="{finding.severity}" title="{finding.severity}">{MARKS[finding.severity]}</span>'
        f"{escape(finding.sentence)}</li>"
        for finding in health.worst_first
    ]
    return f'<ul class="findings">{"".join(items)}</ul>'


# --- the report of a comparison ---------------------------------------------------------------------------------------

SECTIONS: tuple[Section[Comparison], ...] = (
    Answer(),
    ErrorsPerSignal(),
    HeldOut(),
    WorstRegions(),
    WhatExplains(),
    Recordings(),
    CalibrationTable(),
    DataHealth(),
)


def write_report(comparison: Comparison, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    names = ", ".join(one.name or "recording" for one in comparison.recordings)
    titles = {"adequate": "The model is adequate", "uninformative": "The recordings tell nothing of the model"}
    title = titles.get(comparison.verdict, "Where the model fails")
    if comparison.adequate and not comparison.is_within_band:
        title = "The model leaves a little more than noise"
    write(path, page(title, f"{comparison.actuator.name} against {names}", SECTIONS, comparison))
