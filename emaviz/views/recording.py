"""A view as a recording for the Rerun viewer: the words, and each figure as a picture of its lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import rerun.blueprint as rrb

from ema_model.errors import InputError
from ema_model.result import Result
from emaviz import colours
from emaviz.recording import blueprint
from emaviz.recording.entry import ANSWER, RecordingError
from emaviz.recording.writer import RecordingWriter, written
from emaviz.views import View, figures_of

_AIR = 0.05  # of the range, above and below what is drawn
_LEAST_POINTS = 2  # of a line
_TAG = ("<b>", "</b>", "<sub>", "</sub>")


def write_recording(view: View[Any], result: Result, path: Path, configuration: Mapping[str, Any]) -> None:
    """Writes a whole .rrd file; InputError in one line where that cannot be done.

    /answer says the result in words; the figures are static pictures below /NAME/SECTION; properties hold the JSON
    form of the result, and the configuration.
    """
    try:
        with ViewWriter(path, view, result) as writer:
            writer.properties({view.name: result.to_dict(), "configuration": dict(configuration)})
            writer.answer(written(view.title(result), result.document.blocks))
            writer.draw()
    except RecordingError as error:
        raise InputError(str(error)) from None
    if writer.failed is not None:
        raise InputError(writer.failed)


class ViewWriter(RecordingWriter):
    """A recording of what a view lists."""

    def __init__(self, path: Path, view: View[Any], result: Result) -> None:
        super().__init__(path)
        self._view, self._result = view, result
        self._pictures: dict[str, list[rrb.Spatial2DView]] = {}  # by section

    def __enter__(self) -> ViewWriter:
        return self

    def draw(self) -> None:
        """All figures that have lines, section by section."""
        for section in self._view.sections:
            for number, figure in enumerate(figures_of(section.pieces(self._result)), 1):
                root = f"/{self._view.name}/{section.anchor.replace('-', '_')}/figure_{number}"
                if self._drawn(figure, root):
                    shown = blueprint.view(_text(figure.layout.title.text), [f"{root}/**"])  # type: ignore[union-attr]
                    self._pictures.setdefault(section.title, []).append(shown)

    def _drawn(self, figure: go.Figure, root: str) -> bool:
        """Draws the lines of a figure in one picture; False where it has none."""
        lines = list(_lines(figure))
        if not lines:
            return False
        layout: Any = figure.layout
        x, y = (np.concatenate([line[side] for line in lines]) for side in (1, 2))
        low, high = float(np.min(y)), float(np.max(y))
        air = _AIR * ((high - low) or abs(high) or 1.0)
        units = (_text(axis.title.text).rpartition("[")[2].rstrip("]") for axis in (layout.xaxis, layout.yaxis))
        across, up = units
        is_log = layout.xaxis.type == "log"
        chart = blueprint.Chart(up, float(np.min(x)), float(np.max(x)), low - air, high + air, across, is_log)
        self._file.do(lambda stream: chart.log_axes(stream, root))
        for number, (name, x, y, colour) in enumerate(lines, 1):
            points = chart.strip(x, y)
            drawn = [("line", blueprint.model(points, colour))]
            drawn += [("name", blueprint.name_at(points[-1], name, colour))] if name else []
            for what, archetype in drawn:
                path = f"{root}/{what}_{number}"
                self._file.do(lambda stream, path=path, one=archetype: stream.log(path, one, static=True))
        return True

    def _layout(self) -> rrb.Blueprint:
        words = rrb.TextDocumentView(origin=ANSWER, name="The answer")
        pictures = [rrb.Vertical(*views, name=title) for title, views in self._pictures.items()]
        tabs = [rrb.Horizontal(words, *pictures[:1], column_shares=[2, 3], name="The answer") if pictures else words]
        tabs += pictures[1:]
        return blueprint.arranged(self._contents, tabs)


def _lines(figure: go.Figure) -> Iterator[tuple[str, np.ndarray, np.ndarray, tuple[int, int, int, int]]]:
    """Name, points and colour of each line of a figure; of a band its edge, without what is no number."""
    is_log = figure.layout.xaxis.type == "log"  # type: ignore[union-attr]
    for trace in figure.data:
        one: Any = trace
        if one.type != "scatter" or one.x is None or one.y is None:
            continue
        try:
            x, y = (np.array(side, dtype=float) for side in (one.x, one.y))
        except (TypeError, ValueError):  # names in place of numbers
            continue
        known = np.isfinite(x) & np.isfinite(y) & ((x > 0.0) | (not is_log))
        if known.sum() < _LEAST_POINTS:
            continue
        colour = one.line.color or one.marker.color
        hexadecimal = colour if isinstance(colour, str) and colour.startswith("#") else colours.COMMAND
        name = _text(one.name) if one.showlegend is not False else ""
        x = np.log10(x[known]) if is_log else x[known]
        yield name, x, y[known], (*colours.rgb(hexadecimal), 255)


def _text(text: object) -> str:
    """Without Plotly's tags."""
    plain = str(text or "")
    for tag in _TAG:
        plain = plain.replace(tag, "")
    return plain
