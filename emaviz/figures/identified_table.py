"""Identifications in numbers, a row each: error, time, simulations, performance coefficient."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from emaviz.figures.convergence import named
from emaviz.text.html import Html, html, joined

_MISSING = "–"
_NUMBER = Html('style="text-align:right;padding:1px 4px"')


@dataclass(frozen=True)
class Row:
    """One optimiser's answer."""

    race: int  # number of the race it ran in
    source: str
    algorithm: str
    population: int
    iterations: int
    fitness: str
    seed: int
    error_percent: float | None  # T 5.2, where the truth is known
    rmse_A: float  # uncorrected
    evaluations: int
    elapsed_s: float  # of this optimiser alone, without compilation
    performance: float | None  # %, T 5.4, over the optimisers of its race
    stopped: bool = False
    corrected_A: float | None = None  # by one fit for its race; none of a row that an earlier version saved


def table(rows: Sequence[Row]) -> Html:
    """HTML, the newest race first."""
    if not rows:
        return html(
            '<div style="padding:6px 12px;font-size:13px;line-height:1.5">Nothing has been identified yet.'
            '<div style="opacity:.75">Press <b>Identify</b> on the left. Each algorithm of each run then has a row '
            "here: error of k [%] where the faults are known, corrected error of the current [A], time [s], number of "
            "simulations, and the performance coefficient [%], which compares algorithms that ran together.</div></div>"
        )
    heads = ("", "Err [%]", "corrected error [A]", "time [s]", "simulations", "PC [%]")
    head = joined(html("<th {}>{}</th>", _NUMBER, name) for name in heads)
    body = []
    for race in sorted({row.race for row in rows}, reverse=True):
        mine = [row for row in rows if row.race == race]
        first = mine[0]
        said = (
            f"{race}: {first.source} · population {first.population}, {first.iterations} iterations, "
            f"{first.fitness}, seed {first.seed}"
        )
        body.append(html('<tr><td colspan="6" style="padding-top:8px;opacity:.75">{}</td></tr>', said))
        body += [_row(row) for row in mine]
    return html(
        '<div style="padding:4px 10px;font-size:12.5px;font-variant-numeric:tabular-nums">'
        '<table style="width:100%;border-collapse:collapse"><tr>{}</tr>{}</table>'
        '<div style="font-size:11px;opacity:.7;padding-top:8px">Err: the thesis’s equation 5.2, if the truth is known. '
        "Corrected error: rms of measured less model current, with what the simplified model is known to lack added. "
        "Time: of the optimiser alone. PC: its performance coefficient, 5.4, 100 (1 − Err·t / Σ Err·t) over the "
        "optimisers of one race; higher is better.</div></div>",
        head,
        joined(body),
    )


def _row(row: Row) -> Html:
    cells = (
        _MISSING if row.error_percent is None else f"{row.error_percent:.2f}",
        _MISSING if row.corrected_A is None else f"{row.corrected_A:.4f}",
        f"{row.elapsed_s:.2f}",
        f"{row.evaluations}",
        _MISSING if row.performance is None else f"{row.performance:.1f}",
    )
    stopped = " (stopped)" if row.stopped else ""
    return html(
        "<tr><td>{}{}</td>{}</tr>",
        named(row.algorithm),
        stopped,
        joined(html("<td {}>{}</td>", _NUMBER, cell) for cell in cells),
    )
