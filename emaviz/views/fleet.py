"""Units of one type beside each other: in what they differ, whose model suits whom, and the physics that they lack."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike
from plotly.subplots import make_subplots

from ema_model.actuator.parameters import on_axes
from ema_model.fleet.discovery import UnitsDiscovered
from ema_model.fleet.discovery import headline as headline_of_discovery
from ema_model.fleet.result import UnitsCompared, headline
from ema_model.quantities import HALF_90, Quantity, amount, in_sentence, number, of_signal
from emaviz.colours import LIMIT, REFERENCE
from emaviz.figures import theme
from emaviz.text.verdicts import Meaning, of_units
from emaviz.views import ANSWER, Figures, Piece, Section, View

# --- each unit's parameters with their intervals, beside what the type shares -----------------------------------------
# Each unit's parameters with their intervals, beside what the type shares: a small chart for each parameter.

_TYPE = "rgba(134,142,150,0.30)"
_SIGNS = "grey band: nine of ten units of the type; ◆: the unit differs from it"
_COLUMNS = 3
_HEAD_PX, _AXIS_PX = 54, 60  # of the whole, and below each chart
_LEAST_ROW_PX, _ROW_PX, _MOST_ROW_PX = 11, 17, 40  # of a unit in it: as it can be read, easily, and with much room


def unit_parameters(result: UnitsCompared, *, dark: bool = False) -> go.Figure:
    """Those that the recordings tell, what differs first; units that differ are diamonds, the type is the grey band."""
    paths = shown(result)
    if not paths:
        return theme.missing("Parameters of each unit", "the recordings tell none of them", dark=dark)
    rows = -(-len(paths) // _COLUMNS)
    grid: Any = make_subplots(
        rows=rows,
        cols=_COLUMNS,
        shared_yaxes=True,
        horizontal_spacing=0.05,
        vertical_spacing=min(_AXIS_PX / (least_px(result) - _HEAD_PX - _AXIS_PX), 0.9 / max(rows - 1, 1)),
    )
    like: Any = theme.new("Parameters of each unit, fitted alone (90 %)", "", "", dark=dark).layout
    grid.update_layout(template=like.template, title=like.title)
    grid.layout.title.text += f'<br><span style="font-size:11px">{_SIGNS}</span>'
    grid.layout.title.update(y=1.0, yref="container", yanchor="top", pad={"t": 20})  # both lines stand in the figure
    names = [theme.plain(name) for name in result.units]
    for place, path in enumerate(paths):
        where = {"row": place // _COLUMNS + 1, "col": place % _COLUMNS + 1}
        one, of_type = result.alone[path], result.of_type[path]
        named = on_axes(path, result.actuator.axes)
        ends = of_type.mean + np.array([-1.0, 1.0]) * HALF_90 * of_type.sigma
        axis = Quantity(named.title, of_type.unit).powered(np.append(one.value, ends))
        differs = {difference.unit for difference in result.differences if path in difference.together}
        low, high = axis.factor * ends
        grid.add_trace(
            go.Scatter(
                x=axis.factor * one.value,
                y=names,
                error_x={"array": axis.factor * HALF_90 * one.sigma, "thickness": 1.5, "width": 4, "color": theme.EDGE},
                mode="markers",
                marker={
                    "size": [10 if unit in differs else 7 for unit in result.units],
                    "symbol": ["diamond" if unit in differs else "circle" for unit in result.units],
                    "color": [LIMIT if unit in differs else REFERENCE for unit in result.units],
                },
                showlegend=False,
                hovertemplate="%{y}: %{x:.5g} ± %{error_x.array:.2g}<extra></extra>",
            ),
            **where,
        )
        grid.add_vrect(x0=low, x1=high, fillcolor=_TYPE, line_width=0, layer="below", **where)
        grid.update_xaxes(
            title={"text": f"{theme.plain(axis.title)}<br>[{theme.plain(axis.unit or '-')}]", "font": {"size": 10}},
            tickfont={"size": 10},
            nticks=4,
            exponentformat="none",
            **where,
        )
    grid.update_yaxes(autorange="reversed", tickmode="linear", dtick=1, tickfont={"size": 9})
    grid.update_layout(margin={"l": 48, "r": 14, "t": _HEAD_PX, "b": _AXIS_PX})
    return grid


def shown(result: UnitsCompared) -> list[str]:
    """The parameters that are told, those in which units differ first."""
    differ = list(dict.fromkeys(path for one in result.differences for path in one.together))
    return [*differ, *(path for path, one in result.of_type.items() if one.told and path not in differ)]


def height_px(result: UnitsCompared) -> int:
    """As all of it is read easily."""
    return _height_px(result, _ROW_PX)


def least_px(result: UnitsCompared) -> int:
    """Of a figure that can still be read."""
    return _height_px(result, _LEAST_ROW_PX)


def most_px(result: UnitsCompared) -> int:
    """Above which it would only look empty."""
    return _height_px(result, _MOST_ROW_PX)


HEIGHTS_PX = least_px, height_px, most_px  # from the least


def _height_px(result: UnitsCompared, row_px: int) -> int:
    rows = -(-max(len(shown(result)), 1) // _COLUMNS)
    return _HEAD_PX + rows * (_AXIS_PX + row_px * (len(result.units) + 1))


# --- the error of each unit's own model on each unit's recordings, in floors and in the signal's unit -----------------

_SHADES = [[0.0, "rgba(224,49,49,0.05)"], [1.0, "rgba(224,49,49,0.6)"]]  # text stays legible, on dark too
_FAR = 1.5  # times the own model's error, from which on a cell is dark
_IN_FULL, _IN_SHORT = 7, 12  # units, up to which a cell has both numbers, and up to which the floors alone


def transfer_matrix(result: UnitsCompared, *, dark: bool = False) -> go.Figure:
    """A row for each model, a column for each unit's recordings; the darker, the worse than that unit's own model."""
    moved, axes = result.transfer, result.actuator.axes
    shown = of_signal(moved.signal, axes)
    full = len(result.units) <= _IN_FULL
    beside = f", and rms of the {in_sentence(shown.title)}" if full else ""
    chart = theme.new(f"Error, × noise floor{beside}", "Recordings of", "Model of", dark=dark)
    names = [theme.plain(name) for name in result.units]
    errors = [[amount(value, shown.unit) for value in row] for row in moved.error]
    worse = moved.floors / np.maximum(np.diag(moved.floors), 1e-300)
    text = None
    if len(names) <= _IN_SHORT:
        text = [
            [f"{number(value, 2)} ×" + (f"<br>{error}" if full else "") for value, error in zip(row, beside)]
            for row, beside in zip(moved.floors, errors)
        ]
    chart.add_trace(
        go.Heatmap(
            z=worse,
            zmin=1.0,
            zmax=max(_FAR, float(np.max(worse))),
            x=names,
            y=names,
            text=text,
            texttemplate="%{text}" if text else None,
            customdata=errors,
            hovertemplate="model of %{y} on %{x}: %{customdata}, %{z:.2f} × its own model's<extra></extra>",
            colorscale=_SHADES,
            textfont={"color": (theme.DARK if dark else theme.LIGHT).ink},
            xgap=1,
            ygap=1,
            colorbar={
                "thickness": 10,
                "nticks": 5,
                "exponentformat": "none",
                "separatethousands": True,
                "title": {"text": "× own model's error", "side": "right", "font": {"size": 11}},
            },
        )
    )
    chart.update_yaxes(autorange="reversed", nticks=0, showgrid=False, title={"standoff": 12})
    chart.update_xaxes(nticks=0, showgrid=False)
    return chart


# --- the view ---------------------------------------------------------------------------------------------------------


def _parameters(result: UnitsCompared) -> Sequence[Sequence[go.Figure]]:
    """As each unit's own recordings tell them; left out where nothing is told."""
    return [[unit_parameters(result)]] if shown(result) else []


def _transfer(result: UnitsCompared) -> Sequence[Sequence[go.Figure]]:
    """The error of each model on each unit, in floors."""
    return [[transfer_matrix(result)]]


def _lead(result: UnitsCompared) -> str:
    return f"{result.actuator.name}, {len(result.units)} units"


def _columns(result: UnitsCompared) -> Mapping[str, ArrayLike]:
    """A row for each unit: its parameters as its own recordings tell them, with 1 σ."""
    found: dict[str, ArrayLike] = {"unit": np.array(result.units)}
    for path, one in result.alone.items():
        name = result.name_in_files(path)
        found |= {name: one.value, f"{name}_sigma": one.sigma}
    return found


SECTIONS: tuple[Section[UnitsCompared], ...] = (
    ANSWER,
    Section("Parameters of each unit", "parameters", (Figures(_parameters, height_px),)),
    Section(
        "The model of one unit on another",
        "transfer",
        (Figures(_transfer, lambda result: 160 + 28 * len(result.units)),),
    ),
)

UNITS = View(
    of=UnitsCompared,
    name="units",
    title=headline,
    lead=_lead,
    sections=SECTIONS,
    meaning=of_units,
    columns=_columns,
)


# --- the physics that units lack, and beside it what they differ in, as a comparison of the units shows it ------------


def _of_compared(one: Section[Any]) -> Section[UnitsDiscovered]:
    """A comparison's section, of the comparison that is in a discovery."""

    def pieces(result: UnitsDiscovered) -> Iterable[Piece]:
        return one.pieces(result.compared)

    return Section(one.title, one.anchor, of=pieces)


def _lead_of_discovery(result: UnitsDiscovered) -> str:
    return f"{result.actuator.name}, {len(result.units)} units"


def _meaning_of_discovery(result: UnitsDiscovered) -> Meaning:
    return "found" if result.lacks else "good"


UNITS_DISCOVERED = View(
    of=UnitsDiscovered,
    name="units_discovery",
    title=headline_of_discovery,
    lead=_lead_of_discovery,
    sections=(ANSWER, *(_of_compared(one) for one in SECTIONS if one != ANSWER)),
    meaning=_meaning_of_discovery,
)

VIEW = (UNITS, UNITS_DISCOVERED)
