"""The report of an identification: its sections in reading order, and the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from ema_model import faults
from ema_model.actuator.actuator import readings, sentences
from ema_model.actuator.parameters import on_axes
from ema_model.identification.run import Identification, algorithm_title
from ema_model.identification.search import Objective
from ema_model.identification.words import CORRECTED, verdict
from ema_model.quantities.numbers import amount, number
from emaviz import __version__
from emaviz.figures import identification, theme
from emaviz.figures.identification import colour, error_title, fault_bars
from emaviz.report.html_document import Figures, Section, bullets, page, paragraph, table, write
from emaviz.text.results import sure_words


@dataclass(frozen=True, eq=False)
class Identified:
    """An answer, what it was fitted to, and how it was asked for."""

    answer: Identification
    objective: Objective
    holdout_rmse: float | None  # A
    configuration: Mapping[str, Any]


# --- k1 … k8 with their intervals, and what they mean -----------------------------------------------------------------

_MARK = "\x1e"  # before a k that is surely not healthy


class Faults(Section[Identified]):
    """The answer: in words, as bars, in numbers."""

    title = "Faults"
    anchor = "faults"

    def body(self, subject: Identified, figures: Figures) -> str:
        """Always there."""
        answer, actuator = subject.answer, subject.objective.actuator
        sure = answer.uncertainty
        rows = [
            [
                f"{fault.name} {fault.title}",
                phrase,
                f"{_MARK if fault.name in sure.alarms else ''}{answer.k[i]:.4f}",
                f"{sure.interval90[i, 0]:.4f} … {sure.interval90[i, 1]:.4f}",
                *([] if answer.truth is None else [f"{answer.truth[i]:.4f}"]),
            ]
            for i, (fault, phrase) in enumerate(zip(faults.FAULTS, sentences(answer.k, actuator)))
        ]
        heads = ["Fault", "meaning", "k", "90 % interval", *([] if answer.truth is None else ["truth"])]
        physical = [[name.replace("_", " "), number(v)] for name, v in readings(answer.k, actuator).items()]
        return "".join(
            [
                sure_words(answer),
                fault_bars(
                    answer.k, actuator, answer.truth, sure.interval90, sure.alarms, sure.detectable, sure.adequate
                ),
                table(heads, rows, text_columns=2, marked=_MARK),
                table(["Physical reading", "value"], physical),
                bullets(sure.warnings, "warning"),
            ]
        )


# --- the measured current beside the Monitor Model's at the answer, and what is left ----------------------------------


class Fit(Section[Identified]):
    """Two figures for each recording, and the errors."""

    title = "Fit"
    anchor = "fit"

    def body(self, subject: Identified, figures: Figures) -> str:
        """Always there."""
        held = subject.holdout_rmse
        answer = subject.answer
        beside = "" if held is None else f"; {amount(held, 'A')} on the recordings that were not fitted"
        parts = [
            paragraph(
                f"Corrected error {amount(answer.corrected_rmse, 'A')}; as it is drawn here, uncorrected, "
                f"{amount(answer.rmse, 'A')}{beside}. {CORRECTED}"
            )
        ]
        for chart in identification.figures(subject.objective, subject.answer.k):
            parts.append(figures.place(chart, 320))
        return "".join(parts)


# --- how the search came to its answer --------------------------------------------------------------------------------


class Convergence(Section[Identified]):
    """The best error of each iteration."""

    title = "Convergence"
    anchor = "convergence"

    def body(self, subject: Identified, figures: Figures) -> str:
        """Always there."""
        answer = subject.answer
        chart = theme.new("Best error of each iteration", "Iteration", error_title(True))
        drawn = {"color": colour(answer.algorithm), "width": 2}
        chart.add_trace(go.Scatter(y=answer.corrected_history, mode="lines", line=drawn, showlegend=False))
        chart.update_yaxes(type="log")
        ended = ", stopped by the user" if answer.stopped else ", then a least-squares fit" if answer.polished else ""
        told = f"{algorithm_title(answer.algorithm)}{ended}: {answer.evaluations} simulations"
        return paragraph(f"{told} in {answer.elapsed_s:.2f} s.") + figures.place(chart, 300)


# --- with what the report was made, so that it can be made again ------------------------------------------------------


class Settings(Section[Identified]):
    """Options, and the actuator's parameters that the fit moved beside k."""

    title = "How it was made"
    anchor = "made"

    def body(self, subject: Identified, figures: Figures) -> str:
        """Always there."""
        given = {name: value for name, value in subject.configuration.items() if value not in (None, [], "")}
        actuator = subject.objective.actuator
        rows = [[name.replace("_", " "), value] for name, value in ({"actuator": actuator.name} | given).items()]
        made = table(["Setting", "value"], [*rows, ["emaviz", __version__]], text_columns=2)
        moved = [
            [on_axes(path, actuator.axes).path, number(float(actuator.value(path)), 4), number(value, 4)]
            for path, value in subject.answer.parameters.items()
        ]
        return made + (table(["Moved beside k", "file", "fitted"], moved) if moved else "")


# --- the report of an identification, section by section --------------------------------------------------------------

SECTIONS: tuple[Section[Identified], ...] = (Faults(), Fit(), Convergence(), Settings())


def write_identification_report(
    answer: Identification,
    objective: Objective,
    path: str | Path,
    holdout_rmse: float | None = None,
    configuration: Mapping[str, Any] | None = None,
) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written.

    holdout_rmse: A, of the answer on recordings that were not fitted; configuration: the options.
    """
    subject = Identified(answer, objective, holdout_rmse, configuration or {})
    names = ", ".join(one.name or "a simulated run" for one in objective.measurements)
    told = verdict(answer)
    write(path, page(told[:1].upper() + told[1:], f"{objective.actuator.name} against {names}", SECTIONS, subject))
