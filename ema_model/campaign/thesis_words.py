"""The thesis's evaluation beside ours in words: sentences, and the tables that a terminal and a report show."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ema_model.campaign.thesis import (
    ALGORITHMS,
    MISSED_PERCENT,
    MULTIPLE,
    SINGLE,
    TARGET_PERCENT,
    TITLES,
    Evaluation,
    Spread,
)
from ema_model.identification.run import ROBUST
from ema_model.text import Document, Lines, Table

NONE = "–"
NAMES = {**ALGORITHMS, ROBUST: "Robust"}


def document_of(of: Evaluation) -> Document:
    """The short table, and what it says."""
    (first, *heads), rows = short_table(of)
    return Document([Table(heads, rows, first), Lines(answer(of))])


def spread(one: Spread | None, digits: int = 2) -> str:
    """'0.69 ± 0.12'; without a deviation where there is one run only."""
    if one is None or not one.count:
        return NONE
    deviation = f" ± {one.deviation:.{digits}f}" if math.isfinite(one.deviation) else ""
    return f"{one.mean:.{digits}f}{deviation}"


def number(value: float | None, digits: int = 2, *, signed: bool = False) -> str:
    """'−0.13', or a dash."""
    if value is None or not math.isfinite(value):
        return NONE
    value = round(value, digits) + 0.0  # no −0.00
    return f"{value:{'+' if signed else ''}.{digits}f}".replace("-", "−")


def answer(of: Evaluation) -> list[str]:
    """What comes first, in sentences."""
    robust = of.mean_error(ROBUST)
    cases = sum(one.algorithm == ROBUST and one.error.count > 0 for one in of.scores)
    parts = []
    if math.isfinite(robust):
        runs = sum(one.error.count for one in of.scores if one.algorithm == ROBUST)
        held = "is met" if robust <= TARGET_PERCENT else "is missed"
        parts.append(
            f"Robust identification: Err {robust:.3f} % in the mean of {cases} of 11 actuators ({runs} runs); "
            f"the target of {TARGET_PERCENT:g} % {held}."
        )
    ours = [(NAMES[name], of.mean_error(name), of.printed_mean_error(name)) for name in ALGORITHMS]
    told = [f"{name} {mean:.2f} (thesis {theirs:.2f})" for name, mean, theirs in ours if math.isfinite(mean)]
    if told:
        parts.append(f"The thesis's algorithms at its settings, mean Err %: {', '.join(told)}.")
    others = [
        f"{NAMES[one.algorithm]} {one.error_of_others:.2f}, {one.missed} of {one.count} left out "
        f"(thesis {one.printed_error_of_others:.2f}, {one.printed_missed} of {one.printed_count})"
        for one in of.missed
        if one.printed_count and math.isfinite(one.error_of_others)
    ]
    if others:
        parts.append(f"Without the runs that missed the fault (Err above {MISSED_PERCENT:g} %): {'; '.join(others)}.")
    coefficients = [
        f"{NAMES[one.algorithm]} {one.percent:.1f} (thesis {one.printed.coefficient_percent:.1f})"
        for one in of.coefficients
        if one.fault == SINGLE and one.printed is not None
    ]
    if coefficients:
        parts.append(f"Performance coefficient %, mean of the five faults: {', '.join(coefficients)}.")
    return parts or ["Nothing has been computed yet."]


def short_table(of: Evaluation) -> tuple[list[str], list[list[str]]]:
    """A line a case: the thesis's mean Err and ours, for each algorithm."""
    names = [name for name in NAMES if any(one.algorithm == name and one.error.count for one in of.scores)]
    heads = ["actuator"]
    for name in names:
        heads += [f"{NAMES[name]}, thesis", NAMES[name]] if name in ALGORITHMS else [NAMES[name]]
    lines = []
    for case in dict.fromkeys(one.case.name for one in of.scores):
        own = {one.algorithm: one for one in of.scores if one.case.name == case}
        if not any(one.error.count for one in own.values()):
            continue
        line = [next(iter(own.values())).case.title]
        for name in names:
            one = own.get(name)
            mean = NONE if one is None else number(one.error.mean, 2 if name in ALGORITHMS else 3)
            theirs = NONE if one is None or one.printed is None else number(one.printed.mean)
            line += [theirs, mean] if name in ALGORITHMS else [mean]
        lines.append(line)
    last = ["mean"]
    for name in names:
        mean = number(of.mean_error(name), 2 if name in ALGORITHMS else 3)
        last += [number(of.printed_mean_error(name)), mean] if name in ALGORITHMS else [mean]
    return heads, [*lines, last] if len(lines) > 1 else lines


def row_table(of: Evaluation) -> tuple[list[str], list[list[str]]]:
    """Every case and algorithm: Err and time, the thesis's and ours, and the difference."""
    heads = [
        "Actuator",
        "Algorithm",
        "Thesis: Err %",
        "Ours: Err %",
        "difference",
        "k7 as an angle",
        "Thesis: time s",
        "Ours: time s",
    ]
    lines: list[list[str]] = []
    before = ""
    for one in of.scores:
        digits = 2 if one.algorithm in ALGORITHMS else 3
        title, before = "" if one.case.title == before else one.case.title, one.case.title
        lines.append(
            [
                title,
                NAMES[one.algorithm],
                spread(one.printed),
                spread(one.error, digits),
                number(one.difference, signed=True),
                spread(one.wrapped, digits),
                number(one.printed_time_s, 0),
                spread(one.time_s),
            ]
        )
    return heads, lines


def coefficient_table(of: Evaluation) -> tuple[list[str], list[list[str]]]:
    """T 5.39–5.43: a line a fault and algorithm."""
    heads = ["Fault", "Algorithm", "Thesis: PC %", "Ours: PC %", "difference", "Ours: Err %", "Ours: time s"]
    titles = {**TITLES, SINGLE: "The five, mean (T 5.42)", MULTIPLE: "Several at once (T 5.43)"}
    order = list(titles)
    order.append(order.pop(order.index(MULTIPLE)))
    lines: list[list[str]] = []
    before = ""
    for one in sorted(of.coefficients, key=lambda one: order.index(one.fault)):
        printed = None if one.printed is None else one.printed.coefficient_percent
        title, before = "" if one.fault == before else titles[one.fault], one.fault
        lines.append(
            [
                title,
                NAMES[one.algorithm],
                number(printed),
                number(one.percent),
                number(None if printed is None else one.percent - printed, signed=True),
                number(one.error_percent),
                number(one.time_s),
            ]
        )
    return heads, lines


def aligned(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table for a terminal, the first column left, the others right."""
    rows = [heads, *lines]
    widths = [max(len(row[i]) for row in rows) for i in range(len(heads))]
    return "\n".join(
        "  ".join(cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths)))
        for row in rows
    )
