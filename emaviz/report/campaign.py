"""The report of a campaign: its sections in reading order, and the page."""

from __future__ import annotations

from collections import Counter
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from ema_model import faults
from ema_model.campaign.kinds import benchmark
from ema_model.campaign.store import Store, failed, summaries
from emaviz.figures import campaign
from emaviz.report.html_document import Figures, Section, page, pair, paragraph, table, write
from emaviz.text.campaign import made_with


class Rows:
    """All rows of a campaign, by kind."""

    def __init__(self, store: Store) -> None:
        self.store = store

    @cached_property
    def by_kind(self) -> dict[str, list[dict[str, Any]]]:
        """With how each came about."""
        return {kind: self.store.table(kind, how=True).to_pylist() for kind in set(self.store.header.kinds.values())}

    def answers(self, kind: str) -> list[dict[str, Any]]:
        """The rows of a kind that are no errors."""
        return [row for row in self.by_kind.get(kind, []) if row["error"] is None]

    def grouped(self, kind: str) -> dict[str, list[dict[str, Any]]]:
        """The same by group."""
        groups = dict.fromkeys(row["group"] for row in self.answers(kind))
        return {group: [row for row in self.answers(kind) if row["group"] == group] for group in groups}


# --- how far the campaign is, and with what it was made ---------------------------------------------------------------


class Progress(Section[Rows]):
    """A line a group."""

    title = "Tasks"
    anchor = "tasks"

    def body(self, subject: Rows, figures: Figures) -> str:
        """Always there."""
        lines = [
            [group, one["kind"], one["rows"], one["tasks"], one["errors"]]
            for group, one in subject.store.progress().items()
        ]
        heads = ["Group", "does", "rows", "of", "errors"]
        return paragraph(f"Made with {made_with(subject.store)}.") + table(heads, lines, text_columns=2)


# --- what the rows say together ---------------------------------------------------------------------------------------


class Tables(Section[Rows]):
    """A table a kind of task."""

    title = "Results"
    anchor = "results"

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where there are no rows."""
        parts = []
        for one in summaries(subject.store):
            parts += [paragraph(one.title), table(one.heads, one.lines, text_columns=2)]
        return "".join(parts)


# --- how the errors of the identifications are spread -----------------------------------------------------------------

_LEAST = 3


class Distributions(Section[Rows]):
    """Err %, and how far each k is off."""

    title = "Distributions"
    anchor = "distributions"

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where no truth is known."""
        known = of_known_truth(subject, _LEAST)
        if not known:
            return ""
        parts = [figures.place(errors_drawn(known), 360)]
        drawn = []
        for i, fault in enumerate(faults.FAULTS):
            off = {group: [_off(row, i) for row in rows] for group, rows in known.items()}
            title = f"{fault.label}: found − true"
            drawn.append(figures.place(campaign.error_distribution(title, f"Δ{fault.name} [-]", off), 280))
        parts += [pair(*drawn[at : at + 2]) for at in range(0, len(drawn), 2)]
        return "".join(parts)


def of_known_truth(subject: Rows, least: int = 1) -> dict[str, list[dict[str, Any]]]:
    """Identifications by group, of groups with so many or more."""
    known = {
        group: [row for row in rows if row["k_true"] is not None] for group, rows in subject.grouped("identify").items()
    }
    return {group: rows for group, rows in known.items() if len(rows) >= least}


def errors_drawn(known: dict[str, list[dict[str, Any]]]) -> go.Figure:
    """How Err is spread in each group."""
    errors = {group: [row["error_wrapped_percent"] for row in rows] for group, rows in known.items()}
    return campaign.error_distribution("Error of the identified k", "Err [%]", errors)


def _off(row: dict, i: int) -> float:
    """k7 is an angle."""
    off = row[faults.NAMES[i]] - row["k_true"][i]
    return off - float(np.round(off)) if faults.NAMES[i] == "k7" else off


# --- what was answered how often: verdicts of discoveries, explanations of comparisons --------------------------------

_MOST_ANSWERS = 8
_ROW_PX = 24


class Answers(Section[Rows]):
    """Bars, a row a case."""

    title = "Answers"
    anchor = "answers"

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where nothing was discovered or compared."""
        return "".join(
            figures.place(campaign.counted(title, counts), 130 + _ROW_PX * len(counts))
            for title, counts in answers(subject).items()
        )


def answers(subject: Rows) -> dict[str, dict[str, Counter[str]]]:
    """How often what was answered, by case, of each kind of answer that there is."""
    found: dict[str, dict[str, Counter[str]]] = {}
    for kind, title, answer in (
        ("discover", "What was named", _named),
        ("compare", "What explains the residual first", _explained),
    ):
        rows = [(row, answer(row)) for row in subject.answers(kind)]
        told = [(row, one) for row, one in rows if one is not None]
        often = {one for one, _ in Counter(one for _, one in told).most_common(_MOST_ANSWERS)}
        for row, one in told:
            case = " · ".join(filter(None, (row["group"], row["case"])))
            found.setdefault(title, {}).setdefault(case, Counter())[one if one in often else "another"] += 1
    return found


def _named(row: dict[str, Any]) -> str | None:
    if row["verdict"] is None:
        return None
    return " + ".join(row["effects"]) or row["verdict"]


def _explained(row: dict[str, Any]) -> str:
    return f"{row['variable']} × {row['modulator']}" if row["variable"] else "nothing"


# --- discovery beside the field's own methods: where it is behind stands first ----------------------------------------


class Benchmarks(Section[Rows]):
    """What each method leaves of held-out recordings; a table, their means, and a figure."""

    title = "Benchmarks"
    anchor = "benchmarks"

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where nothing was held beside another method."""
        groups = subject.grouped("benchmark")
        if not groups:
            return ""
        ratios = benchmark.behind_first(groups)
        ordered = {group: groups[group] for group in [*ratios, *(one for one in groups if one not in ratios)]}
        behind = [f"{group}, {ratio:.2f} times" for group, ratio in ratios.items() if ratio > 1.0]
        told = f"Behind the method that its training error chooses: {'; '.join(behind) or 'nowhere'}."
        lines = [
            [
                group,
                row["method"],
                f"{row['fitted_error']:.3g} {row['unit']}",
                f"{row['held_out_error']:.3g} {row['unit']}",
                "–" if row["answer_s"] is None else f"{row['answer_s']:.3g} s",
                ", ".join(row["effects"] or []) or row["verdict"] or "",
            ]
            for group, rows in ordered.items()
            for row in sorted(rows, key=lambda one: one["held_out_error"])
        ]
        heads = ["Recordings", "method", "error fitted", "held out", "time", "names"]
        parts = [paragraph(told), table(heads, lines, text_columns=2)]
        if len(groups) > 1 and (averages := benchmark.means(groups)):
            ranked = sorted(averages.items(), key=lambda one: one[1])
            parts.append(table(["Mean over all", "held out"], [[name, f"{mean:.3g}"] for name, mean in ranked]))
        errors: dict[str, dict[str, float]] = {}
        for group, rows in ordered.items():
            for row in rows:
                errors.setdefault(row["method"], {})[f"{group} [{row['unit']}]"] = row["held_out_error"]
        height = 130 + _ROW_PX * len(groups)
        return "".join([*parts, figures.place(campaign.methods_beside("Error of what was held out", errors), height)])


# --- how the searches converged ---------------------------------------------------------------------------------------


class Convergence(Section[Rows]):
    """A figure a group, a band an algorithm."""

    title = "Convergence"
    anchor = "convergence"

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where nothing was identified."""
        parts = []
        for group, rows in subject.grouped("identify").items():
            histories: dict[str, list[list[float]]] = {}
            for row in rows:
                if row["rmse_history_A"]:
                    histories.setdefault(row["algorithm"], []).append(row["rmse_history_A"])
            if histories:
                parts += [paragraph(f"{group}: {len(rows)} searches"), _placed(histories, figures)]
        return "".join(parts)


def _placed(histories: dict[str, list[list[float]]], figures: Figures) -> str:
    return figures.place(campaign.convergence_bands(histories), 320)


# --- what could not be computed ---------------------------------------------------------------------------------------

_MOST = 200


class Errors(Section[Rows]):
    """A line a task."""

    title = "Errors"
    anchor = "errors"

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where there are none."""
        errors = failed(subject.store)
        if not errors:
            return ""
        lines = [[row["group"], row["case"], row["seed"], row["error"], row["name"]] for row in errors[:_MOST]]
        heads = ["Group", "case", "seed", "error", "task"]
        more = f", of which the first {_MOST} are shown" if len(errors) > _MOST else ""
        return paragraph(f"{len(errors)} tasks ended in an error{more}.") + table(heads, lines, text_columns=5)


# --- what it took: time a task, and the workers' memory ---------------------------------------------------------------

_MOST_WORKERS = 8  # that are drawn


class Effort(Section[Rows]):
    """Two figures."""

    title = "Effort"
    anchor = "effort"

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where nothing was computed."""
        rows = [row for one in subject.by_kind.values() for row in one if row["elapsed_s"] is not None]
        if not rows:
            return ""
        rows.sort(key=lambda row: row["finished_s"])
        seconds: dict[str, list[float]] = {}
        memory: dict[str, tuple[list[float], list[float]]] = {}
        for row in rows:
            seconds.setdefault(row["group"], []).append(row["elapsed_s"])
            if row["memory_MB"] is not None:
                minutes, megabytes = memory.setdefault(row["worker"], ([], []))
                minutes.append((row["finished_s"] - rows[0]["finished_s"]) / 60.0)
                megabytes.append(row["memory_MB"])
        shown = dict(sorted(memory.items(), key=lambda one: -len(one[1][0]))[:_MOST_WORKERS])
        thin = {name: tuple(np.asarray(one)[:: max(1, len(one) // 300)] for one in its) for name, its in shown.items()}
        drawn = [figures.place(campaign.error_distribution("Time of a task", "Time [s]", seconds), 320)]
        if thin:
            drawn.append(figures.place(campaign.worker_memory(thin), 320))  # pyright: ignore[reportArgumentType]
        return pair(*drawn)


# --- the report of a campaign, section by section ---------------------------------------------------------------------

SECTIONS: tuple[Section[Rows], ...] = (
    Progress(),
    Tables(),
    Distributions(),
    Answers(),
    Benchmarks(),
    Convergence(),
    Errors(),
    Effort(),
)


def write_campaign_report(store: Store, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    write(path, page(store.header.title, store.header.about, SECTIONS, Rows(store)))
