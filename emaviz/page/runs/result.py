"""The Runs tab's panel on the right: the Rerun viewer in the page, and two recordings on the same axes."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.recordings import SIGNALS
from emaviz.figures import one_recording, two_recordings
from emaviz.page.inset import COLUMNS
from emaviz.page.page import Page
from emaviz.recording.entry import Entry
from emaviz.recording.read import Recording
from emaviz.text.html import Html, add_html, html
from emaviz.text.notes import begin

_CONFIG = {"displayModeBar": False}
_STEPS = (
    Html("Identify something, or press <b>Record</b> below a comparison or a discovery."),
    "Choose the run on the left: you see what it found, and its current.",
    "Open it in Rerun, on this page or in a tab of its own, or lay two runs over each other.",
)
_NOTHING = begin("Nothing is recorded yet", _STEPS)


class RunsResult:
    """Called on the files' thread."""

    def __init__(self, page: Page, panel: viser.PanelHandle) -> None:
        self._page = page
        self._pair: tuple[tuple[Entry, Any], tuple[Entry, Any]] | None = None
        self._plot: Any = None
        self._told, self._drawn = _NOTHING, False  # of the chosen run
        self._opened, self._dark = ("", ""), False  # the viewer's address and recording; whether the page is dark
        self._tab = panel.add_tab("Rerun", viser.Icon.PLAYER_PLAY)
        gui = page.server.gui
        with self._tab:
            self._frame = add_html(gui, _NOTHING)
            self._glance: Any = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=0.5, visible=False)
            self._close = gui.add_button("Close the viewer", icon=viser.Icon.X, color="gray", visible=False)
        with panel.add_tab("Two runs", viser.Icon.ARROWS_DIFF):
            add_html(gui, COLUMNS)
            self._names = add_html(gui, _hint("Choose two on the left."))
            self._signals: dict[str, str] = {}
            self._signal: Any = gui.add_dropdown("Signal", ("–",), visible=False)
            self._place = gui.add_folder("Signals and search", visible=False)
            self._table = add_html(gui)
        self._close.on_click(lambda _: page.screen.post("viewer", self.close_viewer))
        self._signal.on_update(lambda event: event.client and page.screen.post("two", self._draw))

    def set_dark(self, dark: bool) -> None:
        """The page is dark from now on, or light; a viewer that is open is loaded anew."""
        self._dark = dark
        if self._close.visible:
            self.open(*self._opened)

    def open(self, url: str, name: str) -> None:
        """The viewer with a recording, in the page, as light or dark as that is."""
        self._opened = url, name
        url += f"&theme={'dark' if self._dark else 'light'}"
        self._frame.content = html(
            '<div style="padding:0 10px 4px;font-size:12px;overflow-wrap:anywhere"><b>{}</b> · '
            '<a href="{}" target="_blank" rel="noopener">in a tab of its own ↗</a></div>'
            '<iframe class="emaviz-rerun" src="{}" title="Rerun viewer" '
            'style="width:100%;height:calc(100vh - 240px);border:0"></iframe>',
            name,
            url,
            url,
        )
        self._close.visible, self._glance.visible = True, False

    def show(self, told: Html, recording: Recording | None) -> None:
        """The chosen run, where the viewer is not open: what is said of it, and its current; None for none."""
        figure = one_recording.figure(recording) if recording is not None else None
        self._told, self._drawn = told or _NOTHING, figure is not None
        if figure is not None:
            self._glance.figure = figure
        if not self._close.visible:
            self._frame.content, self._glance.visible = self._told, self._drawn

    def close_viewer(self) -> None:
        """Takes the viewer off the page, which frees its memory."""
        self._close.visible = False
        self._frame.content, self._glance.visible = self._told, self._drawn

    def compare(self, first: tuple[Entry, Any], second: tuple[Entry, Any]) -> None:
        """Two recordings, each as an entry and what was read of it."""
        self._pair = first, second
        names = two_recordings.signals(first[1], second[1]) or ["current_A"]
        self._signals = {SIGNALS[name].title: name for name in names}
        titles = {name: title for title, name in self._signals.items()}
        self._signal.options = tuple(self._signals)
        self._signal.value = titles.get("current_A") or next(iter(self._signals))
        self._signal.visible = self._place.visible = True
        self._names.content = _hint(
            html(
                '<b style="color:{}">A</b> {}<br><b style="color:{}">B</b> {}',
                two_recordings.FIRST,
                first[0].name,
                two_recordings.SECOND,
                second[0].name,
            )
        )
        self._draw()
        self._table.content = two_recordings.table(first[0], second[0])

    def _draw(self) -> None:
        if self._pair is None:
            return
        (_, first), (_, second) = self._pair
        figure = two_recordings.figure(first, second, self._signals.get(str(self._signal.value), "current_A"))
        if self._plot is None:
            with self._place:
                self._plot = self._page.server.gui.add_plotly(figure, config=_CONFIG, aspect=1.1)
        else:
            self._plot.figure = figure


def _hint(text: str) -> Html:
    return html('<div style="padding:8px 12px;font-size:13px;opacity:.8">{}</div>', text)
