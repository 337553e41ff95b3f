"""The app: builds the page and joins it to the session."""

from __future__ import annotations

import argparse
import sys
import threading
import time
import traceback
import webbrowser
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import viser

from ema_model.actuator import load_actuator
from ema_model.discovery.result import Experiment
from ema_model.faults import HEALTHY
from ema_model.recordings import Measurement
from ema_model.simulation import plant
from emaviz.page import compare, discover, explore, identify, library
from emaviz.page import recordings as recordings_tab
from emaviz.page.campaigns.controls import CampaignControls
from emaviz.page.compare.keep import KeepControls
from emaviz.page.compare.leads import leads as compare_leads
from emaviz.page.compare.raw_lines import RawLines
from emaviz.page.compare.result import ResultPanel
from emaviz.page.compare.tab import ComparePanel
from emaviz.page.discover.keep import DiscoveryKeep
from emaviz.page.discover.leads import leads as discover_leads
from emaviz.page.discover.result import DiscoveryPanel
from emaviz.page.discover.tab import DiscoverPanel
from emaviz.page.docked import LEFT_PX, Docked
from emaviz.page.explore.charts import ChartsPanel
from emaviz.page.explore.export import ExportControls
from emaviz.page.explore.seal import SealControls
from emaviz.page.explore.suggested_run import take_experiment, take_separating
from emaviz.page.explore.tab import ExplorePanel
from emaviz.page.identify.result import IdentifyResult
from emaviz.page.identify.tab import IdentifyPanel
from emaviz.page.identify.to_discover import take_to_discover
from emaviz.page.keys import add_keys
from emaviz.page.library.tab import EffectPage, LibraryPanel
from emaviz.page.members import workspaces
from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.page.recordings.result import RecordingsResult
from emaviz.page.recordings.sessions import SessionControls, parts
from emaviz.page.recordings.tab import RecordingsPanel
from emaviz.page.workspaces import Workspaces
from emaviz.recording.viewer import ViewerHost
from emaviz.scene.actuator import ActuatorScene
from emaviz.scene.motion import motion
from emaviz.server.door import Door
from emaviz.server.safe_server import open_server
from emaviz.server.viser_private import Inside
from emaviz.session.archive import Recorded, recovered
from emaviz.session.campaigns import Campaigns
from emaviz.session.compare.comparing import Comparing
from emaviz.session.data_folder import DataFolder
from emaviz.session.discover.discovering import Discovering
from emaviz.session.library import Library
from emaviz.session.session import Session, Simulation
from emaviz.session.worker import Worker
from emaviz.text.html import add_html, html, said

_FASTEST_REDRAW_S = 0.04
_SLOW_REDRAW_S = 0.3  # of what nobody watches while dragging
_NOTE = "padding:6px 12px;font-size:13px;line-height:1.45;border-left:3px solid #e8590c"
_NOT_FROM_ELSEWHERE = "It answers on the machine that runs emaviz only, to a page opened there as localhost"
_BRAND = (47, 111, 222)


class App:
    """One page on one address; `close` ends its threads and servers."""

    def __init__(
        self,
        host: str,
        port: int,
        folder: Path,
        actuator_file: str | None = None,
        files: Sequence[Path] = (),
        allow_hosts: Sequence[str] = (),
        campaigns: Sequence[Path] = (),
    ) -> None:
        """files: recordings to open on Compare, where a window then begins.  InputError: one of them is none.

        campaigns: folders of campaigns to open, beside those below `folder`.
        allow_hosts: names by which other machines may ask for the page (InputError: none, but host is no loopback).
        """
        started = time.perf_counter()
        self.door = Door(host, allow_hosts)
        actuator = load_actuator(actuator_file)
        data = DataFolder(folder)
        given = [data.take_in(file) for file in files]
        recordings = data.recordings
        self.viewer: ViewerHost | None = None
        self.server = open_server(host, port, self.door, lambda: self.viewer.address if self.viewer else None)
        self.viewer, no_viewer = _viewer(recordings)
        self.session = Session(actuator, recordings)
        self.screen = Worker("emaviz-screen", self._on_screen_error, rest_s=_FASTEST_REDRAW_S)
        self._slow_screen = Worker("emaviz-slow-screen", self._on_screen_error, rest_s=_SLOW_REDRAW_S)
        self._recording_files = Worker("emaviz-recordings", self._on_screen_error)
        self._docked = Docked(self.server)
        first = compare.WORKSPACE if given else explore.WORKSPACE
        self.workspaces = Workspaces(self.server, self.screen, self._docked, first.name)
        self.page = Page(self.server, self.session, self.screen, self.workspaces)
        self.comparing = Comparing(self.session, data)
        self.session.open_file = self.comparing.measurement
        self.discovering = Discovering(self.session, self.comparing)
        self.campaigns = Campaigns(self.session, data, campaigns)
        self._build(recordings)
        self._first = threading.Event()
        self.first_picture_s = 0.0
        if not plant.can_be_explored(actuator):
            self._first.set()  # there will be no picture of a run
        events = self.session.events
        events.simulated.append(lambda simulation: self.screen.post("signals", lambda: self._draw(simulation, started)))
        events.status.append(lambda text: self.screen.post("status", lambda: self._status(text)))
        events.told.append(self._told)
        self.session.start()
        for path in given:
            self.comparing.add(data.name_of(path))
        self.explore.note("\n".join(recovered(recordings)))
        if no_viewer:
            self.server.on_client_connect(lambda _: self.page.notify("The Rerun viewer cannot be shown", no_viewer))
        elif self.door.token:
            self.server.on_client_connect(self._greet)

    def _build(self, recordings: Path) -> None:
        gui = self.server.gui
        self._theme(dark=False)
        gui.set_panel_label("emaviz")
        gui.main_panel.dock_left()
        gui.main_panel.set_width(LEFT_PX)
        members = workspaces()
        panels = {one.name: self.workspaces.add(one) for one in members}
        self.signals_panel = panels[explore.WORKSPACE.name]
        actuator = self.session.actuator
        self.scene = ActuatorScene(self.server, round(actuator.motor.pole_pairs))
        self.strip = PlaybackStrip(self.page, self.scene, actuator, self._theme)
        self.playback = self.strip.playback
        search = IdentifyResult(self.page, self._slow_screen, panels[identify.WORKSPACE.name], self.strip)
        opened = RecordingsResult(self.page, panels[recordings_tab.WORKSPACE.name])
        export = ExportControls(self.page, self.scene, self.playback)
        self.charts = ChartsPanel(self.page, self._slow_screen, self.signals_panel, self.strip, export.build)
        export.connect(lambda: self.charts.ghost, lambda: self.charts.window_s)
        with panels[compare.WORKSPACE.name].add_tab("Comparison", viser.Icon.ARROWS_DIFF):
            result = ResultPanel(
                self.page,
                self.strip,
                lambda: RawLines(self.page, self.comparing),
                lambda: compare_leads(self.page, self.discovering),
                lambda: KeepControls(self.page, self.comparing, self.viewer),
            )
        with panels[discover.WORKSPACE.name].add_tab("Discovery", viser.Icon.BULB):
            discovery = DiscoveryPanel(
                self.page,
                self.discovering,
                self.strip,
                lambda: DiscoveryKeep(self.page, self.discovering, self.viewer),
                lambda: discover_leads(self.page, self.discovering),
                self._load_experiment,
            )
        effects = Library(self.session)
        with panels[library.WORKSPACE.name].add_tab("Effect", viser.Icon.BOOK):
            effect = EffectPage(self.page, effects, self.strip)
        self._docked.dock()
        builders: dict[str, Callable[[], None]] = {
            explore.WORKSPACE.name: self._build_explore,
            identify.WORKSPACE.name: lambda: self._build_identify(search, opened),
            compare.WORKSPACE.name: lambda: self._build_compare(result),
            discover.WORKSPACE.name: lambda: self._build_discover(discovery),
            library.WORKSPACE.name: lambda: self._build_library(effects, effect),
            recordings_tab.WORKSPACE.name: lambda: self._build_recordings(
                Recorded(recordings), opened, panels[recordings_tab.WORKSPACE.name], search
            ),
        }
        tabs = gui.add_tab_group()
        for one in members:
            with tabs.add_tab(one.title, one.icon):
                builders[one.name]()
        self.compare.add_drop()
        add_keys(self.page, self.strip, members)
        search.to_explore = partial(take_separating, self.explore)
        self.compare.session_uploaded = self.sessions.uploaded
        self.compare.challenge_uploaded = self.discover.source.uploaded
        self.identify.to_discover = partial(take_to_discover, self.page, self.discovering)

    def _load_experiment(self, one: Experiment, client: viser.ClientHandle | None) -> None:
        take_experiment(self.explore, one)
        self.workspaces.go(explore.WORKSPACE.name, client)

    def _theme(self, dark: bool) -> None:
        self.server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=_BRAND, dark_mode=dark)

    def _build_explore(self) -> None:
        if text := plant.note(self.session.actuator):
            add_html(self.server.gui, html('<div style="{}">{}</div>', _NOTE, text))
        self.explore = ExplorePanel(self.page)
        SealControls(self.page, self.discovering.sealing)

    def _build_recordings(
        self, recorded: Recorded, result: RecordingsResult, right: viser.PanelHandle, search: IdentifyResult
    ) -> None:
        panel = RecordingsPanel(self.page, self.viewer, recorded, self._recording_files, result)
        kept = parts(
            self.page,
            self.comparing,
            self.strip,
            self.explore,
            self.identify,
            search,
            self.compare,
            self.discovering,
        )
        self.sessions = SessionControls(self.page, self.comparing, self._recording_files, kept)

        def opened(path: Path, run: Measurement) -> None:
            panel.choose(path.name)
            self.strip.put(motion(run, HEALTHY, self.session.actuator), recordings_tab.WORKSPACE.name)

        CampaignControls(self.page, self.campaigns, self._recording_files, right, opened)
        self.comparing.events.kept.append(lambda _: panel.refresh_soon())

    def _build_identify(self, result: IdentifyResult, recordings: RecordingsResult) -> None:
        self.identify = IdentifyPanel(self.page, self.comparing, self.viewer, result)
        self.identify.open_viewer = recordings.open

    def _build_compare(self, result: ResultPanel) -> None:
        self.compare = ComparePanel(self.page, self.comparing, result)

    def _build_discover(self, result: DiscoveryPanel) -> None:
        self.discover = DiscoverPanel(self.page, self.discovering, result, self.compare.uploads)

    def _build_library(self, effects: Library, effect: EffectPage) -> None:
        LibraryPanel(self.page, effects, effect)

    @property
    def address(self) -> str:
        """Where the page is."""
        return self.door.address(self.server.get_port())

    def wait_for_first_picture(self, timeout_s: float) -> bool:
        """Whether the first simulation was drawn within that time."""
        return self._first.wait(timeout_s)

    def close(self) -> None:
        """Ends everything that was started."""
        self.playback.close()
        self.discovering.close()
        self.comparing.close()
        self.session.close()
        self.screen.close()
        self._slow_screen.close()
        self._recording_files.close()
        if self.viewer is not None:
            self.viewer.close()
        self.server.stop()

    def _draw(self, simulation: Simulation, started: float) -> None:
        self.charts.show(simulation)
        self.playback.show(simulation)
        self.strip.say()
        self.explore.show_preset()
        self.explore.show_model(simulation)
        if not self._first.is_set():
            self.first_picture_s = time.perf_counter() - started
            self._first.set()

    def _status(self, text: str) -> None:
        self.explore.status.content = said(text)

    def _told(self, title: str, text: str) -> None:
        self.page.notify(title, text)

    def _greet(self, client: viser.ClientHandle) -> None:
        if not self.door.asked_here(Inside(self.server).headers(client.client_id)):
            client.add_notification("The Rerun viewer cannot be shown", f"{_NOT_FROM_ELSEWHERE}.", color="yellow")

    def _on_screen_error(self, error: BaseException) -> None:
        traceback.print_exception(error)


def serve(arguments: argparse.Namespace) -> int:
    """Runs the app until interrupted (the command line's `gui`)."""
    files = [Path(file) for file in arguments.files]
    campaigns = [Path(one) for one in arguments.campaign]
    app = App(
        arguments.host, arguments.port, arguments.data_dir, arguments.actuator, files, arguments.allow_host, campaigns
    )
    port = app.server.get_port()
    print(f"emaviz is at {app.door.entry(port)}  (Ctrl-C ends it)", flush=True)
    if app.door.token:
        print("It is open to the network: whoever has this address, with its token, can use it.", file=sys.stderr)
        print(f"The Rerun viewer is not. {_NOT_FROM_ELSEWHERE}.", file=sys.stderr)
    if arguments.open:
        webbrowser.open(app.door.entry(port, here=True))
    if app.wait_for_first_picture(120.0):
        print(f"first picture after {app.first_picture_s:.1f} s", flush=True)
    try:
        threading.Event().wait()
    finally:
        app.close()
    return 0


def _viewer(recordings: Path) -> tuple[ViewerHost | None, str]:
    """The Rerun viewer's host, or why there is none: the app works without."""
    try:
        return ViewerHost(recordings), ""
    except OSError as error:
        return None, str(error)
