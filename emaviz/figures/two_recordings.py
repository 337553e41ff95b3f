"""Two identifications on the same axes: a signal, what each model leaves of it, and how each search converged."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from ema_model.faults import FAULTS
from ema_model.identification.run import algorithm_title
from ema_model.recordings import SIGNALS
from ema_model.text import COLOURS
from emaviz.colours import RUNS
from emaviz.figures.lines import line
from emaviz.figures.theme import DARK, LIGHT, plain
from emaviz.recording.entry import Entry, error_key, setting
from emaviz.recording.read import Recording
from emaviz.text.html import Html, html, joined

FIRST, SECOND = RUNS
_POINTS = 2000
_ECCENTRICITY, _PHASE = "k6", "k7"  # of which the second means something where the first is seen
_STEPS = [step * 10.0**decade for decade in range(-6, 4) for step in (1, 2, 5)]
_LOG = {"tickvals": _STEPS, "ticktext": [f"{value:g}" for value in _STEPS]}  # in full: Plotly's own have a digit each
_DASHES = ("solid", "dash", "dot", "dashdot")


def signals(*recordings: Recording) -> list[str]:
    """Signals that all of them have in some group, in the first one's order."""
    sets = [[name for group in one.signals.values() for name in group] for one in recordings]
    return [name for name in dict.fromkeys(sets[0]) if all(name in others for others in sets[1:]) and name in SIGNALS]


def figure(first: Recording, second: Recording, signal: str, *, dark: bool = False) -> go.Figure:
    """Rows: the signal as recorded (thin) and fitted (bold), the residual, the best error of each iteration."""
    drawn = make_subplots(rows=3, cols=1, vertical_spacing=0.1, row_heights=[0.4, 0.28, 0.32])
    theme = DARK if dark else LIGHT
    traces = [trace for one in (first, second) for trace in one.identification.values()]
    corrected = all(trace.corrected is not None for trace in traces)  # an older file has none
    for recording, colour, name in ((first, FIRST, "A"), (second, SECOND, "B")):
        for group, width, dash, said in (
            ("reference", 1.2, "dot", "recorded"),
            ("measurement", 1.2, "dot", "recorded"),
            ("monitor", 1.8, "solid", "fitted"),
        ):
            series = recording.signals.get(group, {}).get(signal)
            if series is not None:
                _add(drawn, 1, series.time_s, series.values, f"{name} {said}", colour, dash, width)
        residual = recording.signals.get("residual", {}).get(signal)
        if residual is not None:
            _add(drawn, 2, residual.time_s, residual.values, f"{name} residual", colour, "solid", 1.2, listed=False)
        for place, (algorithm, trace) in enumerate(recording.identification.items()):
            said = plain(f"{name} {algorithm_title(algorithm)}")
            index, errors = trace.iteration, trace.rmse
            if corrected and trace.corrected is not None:
                index, errors = np.arange(len(trace.corrected)), trace.corrected
            _add_search(drawn, index, errors, said, colour, _DASHES[place % len(_DASHES)])
    title, unit = SIGNALS[signal].title, SIGNALS[signal].unit or "-"
    drawn.update_yaxes(title_text=f"{title}<br>[{unit}]", row=1, col=1)
    drawn.update_yaxes(title_text=f"Residual<br>[{unit}]", row=2, col=1)
    which = "Corrected" if corrected else "Uncorrected"
    drawn.update_yaxes(title_text=f"{which}<br>error [A]", type="log", row=3, col=1, **_LOG)
    drawn.update_xaxes(title_text="Time [s]", matches="x", row=2, col=1)
    drawn.update_xaxes(title_text="Iteration", row=3, col=1)
    drawn.update_layout(
        template=theme.template(),
        margin={"l": 66, "r": 12, "t": 8, "b": 0},
        legend={"orientation": "h", "x": 0.02, "xref": "container", "y": 0.0, "yref": "container", "yanchor": "bottom"},
    )
    return drawn


def table(first: Entry, second: Entry) -> Html:
    """HTML: where settings differ, the results, and each k of the best answers."""
    rows = [_row("", _named("A", FIRST), _named("B", SECOND))]
    names = [n for n in dict.fromkeys([*first.settings, *second.settings])]
    for name in names:
        told = [setting(name, one.settings.get(name, "–")) for one in (first, second)]
        if told[0] != told[1]:
            rows.append(_row(told[0][0], told[0][1], told[1][1]))
    if not any(first.settings.get(n) != second.settings.get(n) for n in names) and names:
        rows.append(_row("settings", "the same", "the same"))
    answers = (first.answer, second.answer)
    rows.append(_row("best algorithm", *(algorithm_title(one.best or "–") for one in (first, second))))
    error = error_key(*answers)
    for title, key, form in (
        ("Err [%]", "error_percent", ".2f"),
        (f"{'uncorrected' if error == 'rmse_A' else 'corrected'} error [A]", error, ".4f"),
        ("time [s]", "elapsed_s", ".2f"),
        ("simulations", "evaluations", "d"),
    ):
        rows.append(_row(title, *(_number(answer, key, form) for answer in answers)))
    for i, fault in enumerate(FAULTS):
        values = [answer["k"][i] if answer else None for answer in answers]
        cells = ["–" if value is None else f"{value:.3f}" for value in values]
        known = [value for value in values if value is not None]
        apart = len(known) == 2 and abs(known[0] - known[1]) > 0.02
        if fault.name == _PHASE:
            apart &= all(answer is not None and _ECCENTRICITY in answer["alarms"] for answer in answers)
        mark = html(' style="color:{};font-weight:600"', COLOURS["warning"]) if apart else ""
        rows.append(_row(fault.label, *(html("<span{}>{}</span>", mark, cell) for cell in cells)))
    return html(
        '<div style="padding:4px 10px;font-size:12.5px;font-variant-numeric:tabular-nums">'
        '<table style="width:100%;border-collapse:collapse">{}</table></div>',
        joined(rows),
    )


def _add(
    drawn: go.Figure, row: int, x, y, name: str, colour: str, dash: str, width: float, *, listed: bool = True
) -> None:
    x, y = line(x, y, _POINTS)
    style = {"color": colour, "width": width, "dash": dash}
    drawn.add_trace(
        go.Scatter(x=x, y=y, name=name, mode="lines", line=style, showlegend=listed),
        row=row,
        col=1,
    )


def _add_search(
    drawn: go.Figure, index: NDArray[np.int64], errors: NDArray[np.float64], name: str, colour: str, dash: str
) -> None:
    known: NDArray[np.bool_] = np.isfinite(errors) & (errors > 0.0)
    x = index[known].astype(float)
    drawn.add_trace(
        go.Scatter(x=x, y=errors[known], name=name, mode="lines", line={"color": colour, "dash": dash}),
        row=3,
        col=1,
    )


def _named(name: str, colour: str) -> Html:
    return html('<span style="color:{}">{}</span>', colour, name)


def _number(answer: dict | None, key: str, form: str) -> str:
    value = None if answer is None else answer.get(key)
    return "–" if value is None else f"{value:{form}}"


def _row(name: str, a: str, b: str) -> Html:
    cell = "td" if name else "th"
    right = Html('style="text-align:right;padding:1px 4px;overflow-wrap:anywhere"')
    return html("<tr><td>{}</td><{} {}>{}</{}><{} {}>{}</{}></tr>", name, cell, right, a, cell, cell, right, b, cell)
