"""The app: builds the page and joins it to the session."""

from __future__ import annotations

import argparse
import sys
import threading
import time
import traceback
import webbrowser
from pathlib import Path

import viser

from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from emaviz.figures.signals import LiveSignals
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

    def __init__(self, host: str, port: int, folder: Path, actuator_file: str | None = None) -> None:
        started = time.perf_counter()
        actuator = load_actuator(actuator_file)
        recordings = _folder(folder)
        self.server = open_server(host, port)
        self.viewer = _viewer(recordings)
        self.session = Session(actuator, recordings)
        self.screen = Worker("emaviz-screen", self._on_screen_error, rest_s=_FASTEST_REDRAW_S)
        self.page = Page(self.server, self.session, self.screen)
        self._build(recordings)
        self.playback = Playback(ActuatorScene(self.server))
        self._play.on_update(lambda _: self.playback.play(bool(self._play.value)))
        self._first = threading.Event()
        self.first_picture_s = 0.0
        events = self.session.events
        events.simulated.append(lambda simulation: self.screen.post("signals", lambda: self._draw(simulation, started)))
        events.status.append(lambda text: self.screen.post("status", lambda: self._status(text)))
        events.told.append(self._told)
        self.session.start()
        for found in recover(recordings):
            self.explore.status.content = f"Recovered a recording of an interrupted run: {found}"

    def _build(self, recordings: Path) -> None:
        gui = self.server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(47, 111, 222))
        gui.set_panel_label("emaviz")
        gui.main_panel.dock_left()
        gui.main_panel.set_width(370)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Explore", viser.Icon.ADJUSTMENTS):
            self.explore = ExplorePanel(self.page)
            with gui.add_folder("Picture"):
                self._caption = gui.add_markdown("")
                self._play = gui.add_checkbox("Play", True)
        with tabs.add_tab("Identify", viser.Icon.SEARCH):
            self.identify = IdentifyPanel(self.page, self.viewer)
        with tabs.add_tab("Recordings", viser.Icon.LIST):
            RecordingsPanel(self.page, self.viewer, recordings)
        panel = gui.add_panel()
        with panel.add_tab("Signals", viser.Icon.CHART_LINE):
            self.signals = LiveSignals(gui)
        panel.dock_right()
        panel.set_width(540)

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

    def _status(self, text: str) -> None:
        self.explore.status.content = text

    def _told(self, title: str, text: str) -> None:
        self.page.notify(title, text)
        self.screen.post("told", self.identify.failed)

    def _on_screen_error(self, error: BaseException) -> None:
        traceback.print_exception(error)


def serve(arguments: argparse.Namespace) -> int:
    """Runs the app until interrupted (the command line's `gui`)."""
    if arguments.files:
        raise InputError("opening recordings in the app comes with Compare; use: emaviz identify FILE")
    app = App(arguments.host, arguments.port, arguments.data_dir, arguments.actuator)
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


def _folder(folder: Path) -> Path:
    recordings = folder / "recordings"
    try:
        recordings.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--data-dir {folder}: cannot be made ({error.strerror})") from None
    return recordings


def _viewer(recordings: Path) -> ViewerHost | None:
    """The Rerun viewer's host; the app works without."""
    try:
        return ViewerHost(recordings)
    except OSError:
        return None
