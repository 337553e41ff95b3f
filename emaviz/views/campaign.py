"""A campaign: how far it is, its tables, distributions, answers, benchmarks, convergence, errors and effort."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from ema_model import faults
from ema_model.actuator.parameters import on_axes
from ema_model.campaign import benchmark
from ema_model.campaign.store import Campaign, failed, made_with, summaries
from ema_model.discovery.result import effect_title
from ema_model.effects import CATALOGUE
from ema_model.quantities import ROTARY, amount, explanation_title, in_sentence
from emaviz.figures import campaign
from emaviz.text.verdicts import Meaning
from emaviz.views import Columns, Line, Piece, Row, Section, View

_LEAST = 3  # identifications of a group whose spread is drawn
_MOST_ANSWERS, _ANOTHER = 8, "another"
_ROW_PX = 24
_MOST_ERRORS = 200  # that are listed
_MOST_WORKERS = 8  # that are drawn


def pairs(figures: list[go.Figure], height_px: int) -> Iterator[Row]:
    """Two and two beside each other."""
    return (Row(figures[at : at + 2], height_px) for at in range(0, len(figures), 2))


def in_words(name: str) -> str:
    """'nothing hidden step' of a plan's 'nothing_hidden_step'."""
    return name.replace("_", " ")


def case_in_words(group: str, case: str) -> str:
    """'cogging torque 24.0 mN·m' of the group 'cogging_torque' and its case 'cogging_torque 0.024'."""
    told, of = _VALUE.sub(_value_in_words, case), in_words(group)
    return told if of in told.replace("-", " ") else " · ".join(filter(None, (of, told)))


_VALUE = re.compile(r"\b([a-z]\w*(?:\.\w+)?)([ +=])(-?\d[\d.]*(?:e[+-]?\d+)?)")  # a name and a number in a case


def _value_in_words(told: re.Match[str]) -> str:
    """An effect with its first parameter's value, or a parameter of the actuator; others as they are."""
    name, sign, value = told.groups()
    path = f"effects.{name}.{CATALOGUE[name].parameters[0].name}" if name in CATALOGUE else name
    named = on_axes(path, ROTARY)
    if "." not in path or named.title == path:
        return told.group()
    title = CATALOGUE[name].title if name in CATALOGUE else named.title
    return f"{in_sentence(title)} {sign.strip('= ')}{amount(float(value), named.unit)}"


def tasks(result: Campaign) -> Iterator[Piece]:
    """A line a group."""
    yield Line(f"Made with {made_with(result.store)}.")
    lines = [[group, one["kind"], one["rows"], one["tasks"], one["errors"]] for group, one in result.progress.items()]
    yield Columns(["Group", "does", "rows", "of", "errors"], lines)


def _results(result: Campaign) -> Iterator[Piece]:
    """A table a kind of task."""
    for one in summaries(result.store):
        yield Line(one.title)
        yield Columns(one.heads, one.lines)


def _distributions(result: Campaign) -> Iterator[Piece]:
    """Err %, and how far each k is off, where the truth is known."""
    if not (known := result.of_known_truth(_LEAST)):
        return
    yield Row([errors_drawn(known)], 360)
    drawn = []
    for i, fault in enumerate(faults.FAULTS):
        off = {in_words(group): [_off(row, i) for row in rows] for group, rows in known.items()}
        drawn.append(campaign.error_distribution(f"{fault.label}: found − true", f"Δ{fault.name} [-]", off))
    yield from pairs(drawn, 280)


def errors_drawn(known: dict[str, list[dict[str, Any]]]) -> go.Figure:
    """How Err is spread in each group."""
    errors = {in_words(group): [row["error_wrapped_percent"] for row in rows] for group, rows in known.items()}
    return campaign.error_distribution("Error of the identified k", "Err [%]", errors)


def _off(row: dict, i: int) -> float:
    """k7 is an angle."""
    off = row[faults.NAMES[i]] - row["k_true"][i]
    return off - float(np.round(off)) if faults.NAMES[i] == "k7" else off


def _answers(result: Campaign) -> Iterator[Piece]:
    """Bars, a row a case, of discoveries and comparisons."""
    for title, counts in answers(result).items():
        yield Row([campaign.counted(title, counts)], counted_px(counts))


def counted_px(counts: Mapping[str, object]) -> int:
    """How high such bars are, so that each case has its name."""
    return 130 + _ROW_PX * len(counts)


def answers(result: Campaign) -> dict[str, dict[str, Counter[str]]]:
    """How often what was answered, by case, of each kind of answer that there is."""
    found: dict[str, dict[str, Counter[str]]] = {}
    for kind, title, answer in (
        ("discover", "What was named", _named),
        ("compare", "What explains the residual first", _explained),
    ):
        place = {group: at for at, group in enumerate(result.progress)}  # in the plan's order, not as they ended
        ordered = sorted(result.answers(kind), key=lambda row: (place.get(row["group"], 0), row["case"]))
        rows = [(row, answer(row)) for row in ordered]
        told = [(row, one) for row, one in rows if one is not None]
        often = {one for one, _ in Counter(one for _, one in told).most_common(_MOST_ANSWERS)}
        for row, one in told:
            case = case_in_words(row["group"], row["case"])
            found.setdefault(title, {}).setdefault(case, Counter())[one if one in often else _ANOTHER] += 1
    return found


def _named(row: dict[str, Any]) -> str | None:
    if row["verdict"] is None:
        return None
    return " + ".join(map(effect_title, row["effects"])) or in_words(row["verdict"])


def _explained(row: dict[str, Any]) -> str:
    return explanation_title(row["variable"], row["modulator"])


def _benchmarks(result: Campaign) -> Iterator[Piece]:
    """What each method leaves of held-out recordings: where discovery is behind stands first."""
    groups = result.grouped("benchmark")
    if not groups:
        return
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
    yield Line(told)
    yield Columns(heads, lines)
    if len(groups) > 1 and (averages := benchmark.means(groups)):
        ranked = sorted(averages.items(), key=lambda one: one[1])
        yield Columns(["Mean over all", "held out"], [[name, f"{mean:.3g}"] for name, mean in ranked], 1)
    errors: dict[str, dict[str, float]] = {}
    for group, rows in ordered.items():
        for row in rows:
            errors.setdefault(row["method"], {})[f"{group} [{row['unit']}]"] = row["held_out_error"]
    yield Row([campaign.methods_beside("Error of what was held out", errors)], 130 + _ROW_PX * len(groups))


def _convergence(result: Campaign) -> Iterator[Piece]:
    """A figure a group, a band an algorithm."""
    for group, rows in result.grouped("identify").items():
        histories: dict[str, list[list[float]]] = {}
        for row in rows:
            if row["rmse_history_A"]:
                histories.setdefault(row["algorithm"], []).append(row["rmse_history_A"])
        if histories:
            yield Line(f"{group}: {len(rows)} searches")
            yield Row([campaign.convergence_bands(histories)], 320)


def errors(result: Campaign) -> Iterator[Piece]:
    """What could not be computed, a line a task."""
    found = failed(result.store)
    if not found:
        return
    lines = [[row["group"], row["case"], row["seed"], row["error"], row["name"]] for row in found[:_MOST_ERRORS]]
    more = f", of which the first {_MOST_ERRORS} are shown" if len(found) > _MOST_ERRORS else ""
    yield Line(f"{len(found)} tasks ended in an error{more}.")
    yield Columns(["Group", "case", "seed", "error", "task"], lines, 5)


def effort(result: Campaign) -> Iterator[Piece]:
    """Time a task, and the workers' memory."""
    rows = [row for one in result.by_kind.values() for row in one if row["elapsed_s"] is not None]
    if not rows:
        return
    rows.sort(key=lambda row: row["finished_s"])
    seconds: dict[str, list[float]] = {}
    memory: dict[str, tuple[list[float], list[float]]] = {}
    for row in rows:
        seconds.setdefault(in_words(row["group"]), []).append(row["elapsed_s"])
        if row["memory_MB"] is not None:
            minutes, megabytes = memory.setdefault(row["worker"], ([], []))
            minutes.append((row["finished_s"] - rows[0]["finished_s"]) / 60.0)
            megabytes.append(row["memory_MB"])
    shown = dict(sorted(memory.items(), key=lambda one: -len(one[1][0]))[:_MOST_WORKERS])
    thin = {name: tuple(np.asarray(one)[:: max(1, len(one) // 300)] for one in its) for name, its in shown.items()}
    drawn = [campaign.error_distribution("Time of a task", "Time [s]", seconds)]
    if thin:
        drawn.append(campaign.worker_memory(thin))  # pyright: ignore[reportArgumentType]
    yield Row(drawn, 320)


def _meaning(result: Campaign) -> Meaning:
    rows, count = result.computed
    failures = sum(one["errors"] for one in result.progress.values())
    return "warning" if failures else "good" if rows == count else "open"


VIEW = View(
    of=Campaign,
    name="campaign",
    title=lambda result: result.title,
    lead=lambda result: result.store.header.about,
    sections=(
        Section("Tasks", "tasks", of=tasks),
        Section("Results", "results", of=_results),
        Section("Distributions", "distributions", of=_distributions),
        Section("Answers", "answers", of=_answers),
        Section("Benchmarks", "benchmarks", of=_benchmarks),
        Section("Convergence", "convergence", of=_convergence),
        Section("Errors", "errors", of=errors),
        Section("Effort", "effort", of=effort),
    ),
    meaning=_meaning,
)
