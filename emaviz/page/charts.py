"""Charts on the page: heights, tools, pictures; zoom, cursors, spectrum and difference of a window."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any
from urllib.parse import parse_qsl

import msgspec
import numpy as np
import plotly.graph_objects as go
import viser
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.recordings.signals import event, reading
from emaviz.figures.lines import Lines, Window, difference, spectrum
from emaviz.figures.runs import LEAST_SPACE_PX
from emaviz.page.window_layout import LEFT_PX, TWO_COLUMNS_PX
from emaviz.server.viser_private import Inside, id_of, in_single_precision
from emaviz.text.html import Html, html, unescaped

# --- charts over time that stand below each other, and figures, as high in each window as fills it --------------------

# Heights by which windows are told apart: charts are laid out for the tallest that is no taller than the window.
WINDOWS_PX = (600, 640, 680, 700, 740, 780, 820, 860, 900, 940, 980, 1020, 1060, 1100, 1150, 1200, 1300, 1400)
_USUAL_WIDTH_PX, _USUAL_PX = 1400, 900  # of a window, for which charts are built
_CHART_HEIGHTS_LEAST_PX = 64
_FRAME_PX = 45  # of a column, beside a figure in a folder
_VALUES = 6  # of a chart's height, which its title shares: at most so many values stand at an axis
_LOW_PX, _TITLE_SAVED_PX = 800, 2  # in windows lower than that, a chart's title is so much smaller


@dataclass(frozen=True)
class _Stack:
    """Charts with their heights in the usual window, and what they share besides in a window of two columns, px."""

    charts: tuple[tuple[Any, int], ...]
    beside_px: int


@dataclass(frozen=True)
class _Figure:
    """The height that a figure needs, that it is read at easily, and that it takes at most; what stands besides, px."""

    figure: Any
    least_px: int
    usual_px: int
    most_px: int
    beside_px: int
    columns: int  # of the panel where it stands, at most

    def aspect(self, width_px: int, window_px: int) -> float:
        """In a window; where one column holds everything, and is scrolled, no more than is read easily."""
        columns = self.columns if width_px >= TWO_COLUMNS_PX else 1
        room = window_px - self.beside_px if columns == 2 else self.usual_px
        return min(self.most_px, max(self.least_px, room)) / ((width_px - LEFT_PX) / columns - _FRAME_PX)


class ChartHeights:
    """Stacks of charts, each of which shares among its own what a window has more, or less, than the usual one."""

    def __init__(self, inside: Inside) -> None:
        self._inside = inside
        self._stacks: list[_Stack] = []
        self._figures: dict[str, _Figure] = {}
        self._windows: dict[int, tuple[int, int]] = {}  # width and height, px, by client, as far as they have told

    def add(self, charts: Sequence[Any], spare_px: int = 0, beside_px: int = 0) -> None:
        """A stack of uPlot charts, with their axes; spare_px: what the usual window has left below it.

        beside_px: what it has left besides where the parts of its tab stand in two columns.
        """
        for one in charts:
            in_single_precision(one)  # seven digits are more than a chart has pixels
        more = spare_px // max(len(charts), 1)
        self._stacks.append(_Stack(tuple((one, int(one.height) + more) for one in charts), beside_px))

    def set_figure(self, figure: Any, least_px: int, usual_px: int, most_px: int, beside_px: int) -> None:
        """A Plotly figure alone in its column, from now on as high as that leaves it, between these heights.

        usual_px: where one column holds everything; beside_px: of a window, what else stands above and below it.
        """
        self._set(_Figure(figure, least_px, usual_px, most_px, beside_px, 2))

    def set_height(self, figure: Any, height_px: int) -> None:
        """A Plotly figure as wide as its panel, from now on that high."""
        self._set(_Figure(figure, height_px, height_px, height_px, 0, 1))

    def _set(self, one: _Figure) -> None:
        figure = one.figure
        self._figures[id_of(figure)] = one
        figure.aspect = one.aspect(_USUAL_WIDTH_PX, _USUAL_PX)
        for client in self._inside.pages():
            self._set_aspects(client)

    def fit(self, client: int, window_px: int) -> None:
        """Lays one window out for its height, one of `WINDOWS_PX`."""
        self._windows[client] = self._windows.get(client, (_USUAL_WIDTH_PX, 0))[0], window_px
        self._lay_out(client)
        self._set_aspects(client)

    def fit_width(self, client: int, window_px: int) -> None:
        """Lays one window out for its width."""
        before, height = self._window(client)
        self._windows[client] = window_px, height
        if (before >= TWO_COLUMNS_PX) != (window_px >= TWO_COLUMNS_PX):
            self._lay_out(client)
        self._set_aspects(client)

    def set_axes(self, chart: Any, axes: Sequence[Any]) -> None:
        """Other axes of a chart, in every window as its height asks for."""
        chart.axes = tuple(axes)
        for client in self._inside.pages():
            self._lay_out(client, chart)

    def forget(self, client: int) -> None:
        """A window was closed."""
        self._windows.pop(client, None)

    def _set_aspects(self, client: int) -> None:
        for one in list(self._figures.values()):  # the screen adds one
            self._inside.set_aspect(client, one.figure, one.aspect(*self._window(client)))

    def _window(self, client: int) -> tuple[int, int]:
        return self._windows.get(client, (_USUAL_WIDTH_PX, _USUAL_PX))

    def _lay_out(self, client: int, only: Any = None) -> None:
        width, window_px = self._window(client)
        for stack in self._stacks:
            spare = window_px - _USUAL_PX + (stack.beside_px if width >= TWO_COLUMNS_PX else 0)
            more = spare // len(stack.charts) + (_TITLE_SAVED_PX if window_px < _LOW_PX else 0)
            for chart, usual in stack.charts:
                if only is None or chart is only:
                    height = max(usual + more, _CHART_HEIGHTS_LEAST_PX)
                    self._inside.lay_out(client, chart, height, spaced(chart.axes, height))


def spaced(axes: Sequence[Any], height_px: int) -> tuple[dict[str, Any], ...]:
    """A chart's axes for its height: those that say a least space between values, px, get it in proportion.

    A high chart would else have a value for every line of text; a low one needs that to have two.
    """
    space = max(LEAST_SPACE_PX, height_px // _VALUES)
    return tuple({**axis, "space": space} if "space" in axis else dict(axis) for axis in axes)


def chart_style() -> Html:
    """Titles in low windows, which leave the height to the charts."""
    title = "font-size:13px;line-height:16px"
    return unescaped(f"<style>@media (max-height:{_LOW_PX - 1}px){{.u-title{{{title}}}}}</style>")


# --- what every chart of the page can do: its values stand at the cursor, and a button saves it as a picture ----------
# viser's charts take no functions from Python, so that a script on the page looks at them: live ones (uPlot), static
# ones (Plotly), and pictures of ours in HTML. Where a name in viser's page has changed, the charts are as without it.

_SCRIPT = r"""
(() => {
  window.emavizCharts?.end();
  const make = (css, parent = document.body) => {
    const one = document.createElement('div');
    one.style.cssText = css;
    parent.append(one);
    return one;
  };
  const ink = () => getComputedStyle(document.querySelector('[data-dock-region]') ?? document.body);
  const said = make('position:fixed;z-index:400;pointer-events:none;display:none;padding:3px 7px;white-space:nowrap;' +
    'border-radius:4px;font:12px/1.45 system-ui;font-variant-numeric:tabular-nums;box-shadow:0 1px 6px #0005');
  said.id = 'emaviz-values';
  const save = make('position:fixed;z-index:399;display:none;padding:1px 7px;border-radius:4px;cursor:pointer;' +
    'font:11px/1.6 system-ui;border:1px solid rgba(134,142,150,.5);opacity:.85');
  save.id = 'emaviz-save-chart';
  save.textContent = 'PNG';
  save.title = 'Save this chart as a picture';
  const KINDS = '.uplot, .js-plotly-plot, .emaviz-picture';
  let at = null;
  const live = (root) => Object.values(window.__viserTestpoints?.uplots ?? {}).map(u => u.chart)
    .find(chart => chart?.root === root);
  const shown = (value) => {
    const size = Math.abs(value);
    return (size && (size < 1e-3 || size >= 1e5) ? value.toExponential(3) : String(+value.toPrecision(4)))
      .replace(/-/g, '−');
  };
  const unit = (chart, scale) => /\[([^\]]*)\]/.exec(chart.axes.find(a => a.scale === scale)?.label ?? '')?.[1] ?? '';
  // a line that lies beneath another, as a frozen run that is none
  const hidden = (chart, s) => chart.data.some((line, other) => other > s && chart.series[other].width !== 0 &&
    line.length > 2 && line.every((value, i) => value === chart.data[s][i]));
  const told = (chart, s) => {
    const one = chart.series[s], colour = typeof one.stroke === 'function' ? one.stroke(chart, s) : one.stroke;
    return one.show !== false && one.width !== 0 && one.label && !/^#.{6}00$/.test(colour) && !hidden(chart, s)
      ? colour : null;
  };
  const tell = (event) => {
    const root = event.target.closest?.('.u-over')?.closest('.uplot'), chart = root && live(root);
    const i = chart?.cursor?.idx;
    if (i == null) { said.style.display = 'none'; return; }
    said.replaceChildren(...chart.series.flatMap((one, s) => {
      const value = chart.data[s]?.[i], colour = s && told(chart, s);
      if (value == null || colour === null) return [];
      const line = document.createElement('div'), [, label, of] = /^(.*?)\s*(?:\[(.*)\])?$/.exec(one.label ?? '');
      line.textContent = `${label}  ${shown(value)} ${of ?? unit(chart, one.scale)}`.trimEnd();
      if (s) line.style.cssText = `border-left:3px solid ${colour};padding-left:5px`;
      return [line];
    }));
    const look = ink();
    said.style.background = look.backgroundColor;
    said.style.color = look.color;
    said.style.display = 'block';
    const { width, height } = said.getBoundingClientRect();
    said.style.left = `${event.clientX + 16 + width > innerWidth ? event.clientX - 12 - width : event.clientX + 16}px`;
    said.style.top = `${Math.max(4, Math.min(event.clientY + 14, innerHeight - height - 4))}px`;
  };
  const offer = (event) => {
    if (event.target === save) return;
    at = event.target.closest?.(KINDS) ?? null;
    save.style.display = at ? 'block' : 'none';
    if (!at) return;
    const box = at.getBoundingClientRect(), look = ink();
    save.style.left = `${box.right - 48}px`;
    save.style.top = `${Math.max(box.top + 3, 30)}px`;
    save.style.background = look.backgroundColor;
    save.style.color = look.color;
  };
  const titled = (root) => (root.querySelector('.u-title, .gtitle, [aria-label]')?.textContent ||
    root.querySelector('[aria-label]')?.ariaLabel || 'chart').trim();
  const give = (canvas, name) => {
    const link = document.createElement('a');
    link.href = canvas.toDataURL('image/png');
    link.download = `emaviz ${name.replace(/[^\w.()+ -]+/g, ' ').trim() || 'chart'}.png`;
    link.click();
  };
  const sheet = (width, height, scale) => {
    const canvas = document.createElement('canvas'), look = ink();
    canvas.width = width * scale;
    canvas.height = height * scale;
    const pen = canvas.getContext('2d');
    pen.scale(scale, scale);
    pen.fillStyle = look.backgroundColor;
    pen.fillRect(0, 0, width, height);
    pen.fillStyle = look.color;
    return [canvas, pen];
  };
  const ofLive = (root, chart) => {
    const drawn = chart.ctx.canvas, box = drawn.getBoundingClientRect(), top = 24, below = 22;
    const [canvas, pen] = sheet(box.width, box.height + top + below, drawn.width / box.width);
    pen.font = '600 13px system-ui';
    pen.textAlign = 'center';
    pen.fillText(titled(root), box.width / 2, 16);
    pen.drawImage(drawn, 0, top, box.width, box.height);
    pen.font = '11px system-ui';
    pen.textAlign = 'left';
    let x = 10;
    chart.series.forEach((one, s) => {
      const colour = s && told(chart, s);
      if (!colour) return;
      pen.fillStyle = colour;
      pen.fillRect(x, box.height + top + 10, 14, 3);
      pen.fillStyle = ink().color;
      pen.fillText(one.label, x + 18, box.height + top + 15);
      x += 30 + pen.measureText(one.label).width;
    });
    give(canvas, titled(root));
  };
  const ofPicture = (root) => {
    const svg = root.querySelector('svg').cloneNode(true), box = root.querySelector('svg').getBoundingClientRect();
    svg.setAttribute('xmlns', 'http://www.w3.org/2000/svg');
    svg.setAttribute('width', box.width);
    svg.setAttribute('height', box.height);
    svg.setAttribute('style', `color:${ink().color}`);
    const picture = new Image();
    picture.onload = () => {
      const [canvas, pen] = sheet(box.width, box.height, 2);
      pen.drawImage(picture, 0, 0, box.width, box.height);
      give(canvas, titled(root));
    };
    picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(new XMLSerializer().serializeToString(svg))}`;
  };
  save.onclick = () => {
    if (!at?.isConnected) return;
    const name = `emaviz ${titled(at).replace(/[^\w.()+ -]+/g, ' ').trim()}`;
    if (at.matches('.js-plotly-plot'))
      window.Plotly?.downloadImage(at, { format: 'png', scale: 2, filename: name,
        width: at.clientWidth, height: at.clientHeight });
    else if (at.matches('.uplot')) ofLive(at, live(at));
    else ofPicture(at);
  };
  const hide = () => { said.style.display = 'none'; };
  document.addEventListener('mousemove', tell);
  document.addEventListener('mouseover', offer);
  document.addEventListener('mouseleave', hide);
  window.emavizCharts = { end: () => {
    document.removeEventListener('mousemove', tell);
    document.removeEventListener('mouseover', offer);
    document.removeEventListener('mouseleave', hide);
    said.remove();
    save.remove();
  } };
})();
"""


def add_chart_tools(inside: Inside) -> None:
    """In every page that is or will be open."""
    inside.run(_SCRIPT)


# --- the actuator as a picture: what a window's camera sees, as a PNG file --------------------------------------------

_LONGEST_S = 30.0  # that a browser may take to draw it
_PICTURE_LEAST_PX = 16


def png(pixels: NDArray[np.uint8]) -> bytes:
    """The file of (height, width, 3) pixels."""
    from PIL import Image  # first needed at a click

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


def send_picture(client: viser.ClientHandle, paper: tuple[int, int, int]) -> None:
    """Sends the window what it shows of the scene, on paper of that colour; not on the screen's thread: it waits."""
    camera: Any = client.camera
    size = (max(int(edge), _PICTURE_LEAST_PX) for edge in (camera.image_height, camera.image_width))
    try:
        drawn = client.get_render(*size, transport_format="png", timeout=_LONGEST_S).astype(float)
    except (RuntimeError, TimeoutError):  # the window was closed, does not draw, or sent no picture
        text = "The window has not sent its picture; bring it to the front, and press again."
        client.add_notification("No picture", text, auto_close_seconds=8.0, color="red")
        return
    cover = drawn[..., 3:] / 255.0
    whole = cover * drawn[..., :3] + (1.0 - cover) * np.array(paper, dtype=float)
    client.send_file_download("emaviz actuator.png", png(np.round(whole).astype(np.uint8)), save_immediately=True)


# --- signals on every chart over time: zoom by dragging and wheel, two cursors, spectrum and difference of a window ---
# A script on the page follows the pointer and asks here, over HTTP, about a chart by its key; cursors are each window's
# own. Numbers are of the lines in full resolution, which charts draw with fewer points.

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


def measure_style() -> Html:
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
