"""Signals on every chart over time: zoom by dragging and wheel, two cursors, spectrum and difference of a window.

A script on the page follows the pointer and asks here, over HTTP, about a chart by its key; cursors are each window's
own.  Numbers are of the lines in full resolution, which charts draw with fewer points.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any
from urllib.parse import parse_qsl

import msgspec
import plotly.graph_objects as go

from ema_model.errors import InputError
from ema_model.recordings.window import event, reading
from emaviz.figures.lines import Lines, Window, difference, spectrum
from emaviz.server.viser_private import Inside, id_of
from emaviz.text.html import Html, html, unescaped

HINT = "Drag or wheel: zoom. Click: cursors A and B. Double click: all."


def hint() -> Html:
    """What a chart over time can do, in a line."""
    return html('<div class="emaviz-measure-hint" title="{}">{}</div>', HINT, HINT)


@dataclass(frozen=True, eq=False)
class _Group:
    """Charts that are zoomed together."""

    keys: Sequence[str]
    lines: Callable[[int], Lines | None]
    zoom: Callable[[Window | None], None]


class Measuring:
    """Which charts can be measured, and what is said of them."""

    def __init__(self, post: Callable[[str, Callable[[], None]], None]) -> None:
        """post(kind, job): does it soon, on the screen's thread."""
        self._post = post
        self._charts: dict[str, tuple[_Group, int]] = {}  # by key, with the place in its group

    def add(
        self, charts: Sequence[Any], lines: Callable[[int], Lines | None], zoom: Callable[[Window | None], None]
    ) -> None:
        """Charts of one time base, live ones, or Plotly figures that are `marked`, each of a row or of several.

        lines(place): what one draws, whole, a figure's rows counted on; called on any thread.  zoom(window): draws
        all of them from and to there, or whole for None; called on the screen's thread.
        """
        self._add([_key(chart) for chart in charts], lines, zoom)

    def add_rows(
        self, figure: Any, rows: int, lines: Callable[[int], Lines | None], zoom: Callable[[Window | None], None]
    ) -> None:
        """A Plotly figure whose upper rows are over time."""
        self._add([_key(figure, row) for row in range(rows)], lines, zoom)

    def _add(
        self, keys: Sequence[str], lines: Callable[[int], Lines | None], zoom: Callable[[Window | None], None]
    ) -> None:
        group = _Group(keys, lines, zoom)
        self._charts |= {key: (group, place) for place, key in enumerate(keys)}

    def answer(self, query: str) -> bytes | None:
        """JSON for what the script asks; None for what it would not ask.  On any thread."""
        asked = dict(parse_qsl(query))
        found = self._charts.get(asked.get("chart", ""))
        answers: Mapping[str, Callable[[_Group, int, Mapping[str, float]], Any]] = {
            "read": self._read,
            "zoom": self._zoom,
            "event": self._event,
            "spectrum": self._spectrum,
            "difference": self._difference,
        }
        answer = answers.get(asked.get("do", ""))
        try:
            at = {name: float(asked[name]) for name in ("a", "b", "from", "to") if name in asked}
        except ValueError:
            return None
        if found is None or answer is None or not all(map(math.isfinite, at.values())):
            return None
        try:
            return msgspec.json.encode(answer(*found, at))
        except InputError as error:
            return msgspec.json.encode({"error": str(error)})

    def _read(self, group: _Group, place: int, at: Mapping[str, float]) -> dict[str, Any]:
        """Each line at A, and with B between both."""
        one, a = _drawn(group, place), at.get("a", 0.0)
        rows = []
        for each in one.lines:
            found = reading(each.time_s, each.values, a, at.get("b", a))
            first, last = (found.last, found.first) if at.get("b", a) < a else (found.first, found.last)
            numbers = [first] if "b" not in at else [first, last, last - first, found.mean, found.rms, found.slope]
            rows.append({"name": each.name, "colour": each.colour, "numbers": numbers})
        return {"title": one.title, "unit": one.unit, "rows": rows}

    def _zoom(self, group: _Group, _: int, at: Mapping[str, float]) -> dict[str, Any]:
        window = _window(at)
        self._post(f"zoom {group.keys[0]}", lambda: group.zoom(window))
        return {"window": window}

    def _event(self, group: _Group, place: int, _: Mapping[str, float]) -> dict[str, Any]:
        window = event_of([one for i in range(len(group.keys)) if (one := group.lines(i)) is not None])
        if window is None:
            raise InputError("Nothing here begins and ends, as a step does: all is shown.")
        return self._zoom(group, place, {"from": window[0], "to": window[1]})

    def _spectrum(self, group: _Group, place: int, at: Mapping[str, float]) -> Any:
        return _figure(spectrum(_drawn(group, place), _window(at)))

    def _difference(self, group: _Group, place: int, at: Mapping[str, float]) -> Any:
        return _figure(difference(_drawn(group, place), _window(at)))


def event_of(every: Sequence[Lines]) -> Window | None:
    """When something happens in charts of one time base."""
    found = [event(one.lines[0].time_s, one.lines[0].values) for one in every if one.lines]
    known = [one for one in found if one is not None]
    return (min(low for low, _ in known), max(high for _, high in known)) if known else None


def marked(figure: go.Figure, handle: Any, rows: int = 1) -> go.Figure:
    """The figure, which the script knows by its handle: its upper rows are over time."""
    return figure.update_layout(meta={"chart": id_of(handle), "rows": rows})


def style() -> Html:
    """How bar, cursors and box look."""
    return unescaped(f"<style>{_own('measure.css')}</style>")


def add_measuring(inside: Inside) -> None:
    """In every page that is or will be open."""
    inside.run(_own("measure.js"))


def _own(name: str) -> str:
    return resources.files("emaviz.page").joinpath(name).read_text(encoding="utf-8")


def _key(chart: Any, row: int = 0) -> str:
    return f"{id_of(chart)}:{row}"


def _drawn(group: _Group, place: int) -> Lines:
    one = group.lines(place)
    if one is None:
        raise InputError("nothing is drawn here yet")
    return one


def _window(at: Mapping[str, float]) -> Window | None:
    if "from" not in at or "to" not in at or at["from"] == at["to"]:
        return None
    low, high = sorted((at["from"], at["to"]))
    return low, high


def _figure(figure: go.Figure) -> msgspec.Raw:
    return msgspec.Raw(str(figure.to_json()).encode())
