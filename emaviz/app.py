"""The app: builds the page and joins it to the session."""

from __future__ import annotations

import argparse
import sys
import threading
import time
import traceback
import webbrowser
from collections.abc import Sequence
from pathlib import Path

import viser

from ema_model.actuator import load_actuator
from ema_model.comparison.result import Comparison
from emaviz.comparing import Comparing
from emaviz.data_folder import DataFolder
from emaviz.figures.signals import LiveSignals
from emaviz.panels.compare import ComparePanel
from emaviz.panels.compare_keep import KeepControls
from emaviz.panels.compare_moment import hold
from emaviz.panels.compare_result import ResultPanel
from emaviz.panels.explore import ExplorePanel
from emaviz.panels.identify import IdentifyPanel
from emaviz.panels.page import Page
from emaviz.panels.recordings import RecordingsPanel
from emaviz.recording.recover import recover
from emaviz.recording.viewer import ViewerHost
from emaviz.safe_server import LOOPBACK, open_server
from emaviz.scene.actuator import ActuatorScene
from emaviz.scene.playback import Playback
from emaviz.session import Session, Simulation
from emaviz.worker import Worker

_FASTEST_REDRAW_S = 0.05


class App:
    """One page on one address; `close` ends its threads and servers."""

    def __init__(
        self, host: str, port: int, folder: Path, actuator_file: str | None = None, files: Sequence[Path] = ()
    ) -> None:
        """files: recordings to open on Compare, which is then the first tab.  InputError: one of them is none."""
        started = time.perf_counter()
        actuator = load_actuator(actuator_file)
        data = DataFolder(folder)
        given = [data.take_in(file) for file in files]
        recordings = data.recordings
        self.server = open_server(host, port)
        self.viewer = _viewer(recordings)
        self.session = Session(actuator, recordings)
        self.screen = Worker("emaviz-screen", self._on_screen_error, rest_s=_FASTEST_REDRAW_S)
        self.page = Page(self.server, self.session, self.screen)
        self.comparing = Comparing(self.session, data)
        self.scene = ActuatorScene(self.server)
        self.playback = Playback(self.scene)
        self._build(recordings, compare_first=bool(given))
        self._play.on_update(lambda _: self.playback.play(bool(self._play.value)))
        self._first = threading.Event()
        self.first_picture_s = 0.0
        events = self.session.events
        events.simulated.append(lambda simulation: self.screen.post("signals", lambda: self._draw(simulation, started)))
        events.status.append(lambda text: self.screen.post("status", lambda: self._status(text)))
        events.told.append(self._told)
        self.session.start()
        for path in given:
            self.comparing.add(data.name_of(path))
        for found in recover(recordings):
            self.explore.status.content = f"Recovered a recording of an interrupted run: {found}"

    def _build(self, recordings: Path, compare_first: bool) -> None:
        gui = self.server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(47, 111, 222))
        gui.set_panel_label("emaviz")
        gui.main_panel.dock_left()
        gui.main_panel.set_width(370)
        # Of the two panels on the right one is seen: the one that belongs to what was done last.
        self._signals_panel, self._result_panel = gui.add_panel(), gui.add_panel(visible=False)
        with self._signals_panel.add_tab("Signals", viser.Icon.CHART_LINE):
            self.signals = LiveSignals(gui)
        with self._result_panel.add_tab("Comparison", viser.Icon.ARROWS_DIFF):
            result = ResultPanel(
                self.page,
                lambda: self._bring(self._result_panel),
                self._hold,
                lambda: KeepControls(self.page, self.comparing, self.viewer),
            )
        for panel in (self._signals_panel, self._result_panel):
            panel.dock_right()
            panel.set_width(540)
        builders = [
            lambda tabs: self._build_explore(tabs),
            lambda tabs: self._build_identify(tabs),
            lambda tabs: self._build_compare(tabs, result),
        ]
        tabs = gui.add_tab_group()
        for build in (builders[-1:] + builders[:-1]) if compare_first else builders:
            build(tabs)
        with tabs.add_tab("Recordings", viser.Icon.LIST):
            RecordingsPanel(self.page, self.viewer, recordings)

    def _build_explore(self, tabs: viser.GuiTabGroupHandle) -> None:
        gui = self.server.gui
        with tabs.add_tab("Explore", viser.Icon.ADJUSTMENTS):
            self.explore = ExplorePanel(self.page)
            with gui.add_folder("Picture"):
                self._caption = gui.add_markdown("")
                self._play = gui.add_checkbox("Play", True)

    def _build_identify(self, tabs: viser.GuiTabGroupHandle) -> None:
        with tabs.add_tab("Identify", viser.Icon.SEARCH):
            self.identify = IdentifyPanel(self.page, self.viewer)

    def _build_compare(self, tabs: viser.GuiTabGroupHandle, result: ResultPanel) -> None:
        with tabs.add_tab("Compare", viser.Icon.ARROWS_DIFF):
            self.compare = ComparePanel(self.page, self.comparing, result)

    def _bring(self, panel: viser.PanelHandle) -> None:
        """To the front, on the right; the other one gives way."""
        for one in (self._signals_panel, self._result_panel):
            if one.visible != (one is panel):
                one.visible = one is panel

    def _hold(self, comparison: Comparison, recording: int, time_s: float) -> None:
        self._play.value = False
        hold(self.playback, self.scene, comparison, recording, time_s)

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def wait_for_first_picture(self, timeout_s: float) -> bool:
        """Whether the first simulation was drawn within that time."""
        return self._first.wait(timeout_s)

    def close(self) -> None:
        """Ends everything that was started."""
        self.playback.close()
        self.comparing.close()
        self.session.close()
        self.screen.close()
        if self.viewer is not None:
            self.viewer.close()
        self.server.stop()

    def _draw(self, simulation: Simulation, started: float) -> None:
        with self.server.atomic():
            self.signals.show(simulation.reference, simulation.monitor)
        self.playback.show(simulation)
        caption = self.playback.caption(simulation)
        if self._caption.content != caption:
            self._caption.content = caption
        if self.explore.monitor.value != self.session.settings.monitor:
            self.explore.show_monitor(self.session.settings.monitor)
        if not self._first.is_set():
            self.first_picture_s = time.perf_counter() - started
            self._first.set()
        else:
            self._bring(self._signals_panel)

    def _status(self, text: str) -> None:
        self.explore.status.content = text

    def _told(self, title: str, text: str) -> None:
        self.page.notify(title, text)
        self.screen.post("told", self.identify.failed)

    def _on_screen_error(self, error: BaseException) -> None:
        traceback.print_exception(error)


def serve(arguments: argparse.Namespace) -> int:
    """Runs the app until interrupted (the command line's `gui`)."""
    files = [Path(file) for file in arguments.files]
    app = App(arguments.host, arguments.port, arguments.data_dir, arguments.actuator, files)
    print(f"emaviz is at {app.address}  (Ctrl-C ends it)", flush=True)
    if arguments.host not in LOOPBACK:
        print("It is open to the network: whoever reaches this address can use it.", file=sys.stderr)
    if arguments.open:
        webbrowser.open(app.address)
    if app.wait_for_first_picture(120.0):
        print(f"first picture after {app.first_picture_s:.1f} s", flush=True)
    try:
        threading.Event().wait()
    finally:
        app.close()
    return 0


def _viewer(recordings: Path) -> ViewerHost | None:
    """The Rerun viewer's host; the app works without."""
    try:
        return ViewerHost(recordings)
    except OSError:
        return None
