"""The app in a browser: a tab for each analysis, the actuator, keys, playback."""

from __future__ import annotations

import argparse
import importlib
import sys
import threading
import time
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

import viser

from ema_model.actuator import load_actuator
from ema_model.members import classes_in, members
from ema_model.simulation import plant
from emaviz.page import compare, explore
from emaviz.page.charts import Measuring, add_chart_tools, add_measuring
from emaviz.page.explore import ExploreTab
from emaviz.page.panel import JobBar, follow_theme
from emaviz.page.playback import PlaybackStrip
from emaviz.page.share import Sharing
from emaviz.page.tab import AnyTab, Correction, Shared, Standings, Tab
from emaviz.page.window_layout import LEFT_PX, Docked
from emaviz.page.workspaces import Page, Workspace, Workspaces
from emaviz.recording.viewer import ViewerHost
from emaviz.scene.actuator import ActuatorScene
from emaviz.server.access import Door
from emaviz.server.safe_server import open_server
from emaviz.server.uploads import Uploads
from emaviz.server.viser_private import Inside
from emaviz.session.campaigns import Campaigns
from emaviz.session.compare import Comparing
from emaviz.session.data_folder import DataFolder
from emaviz.session.discover import Discovering
from emaviz.session.explore import Session
from emaviz.session.jobs import Worker, report

# --- finds the tabs: every file here that states a `WORKSPACE` and defines its tab ------------------------------------


def tabs() -> list[type[Tab]]:
    """In their order."""
    found: list[type[Tab]] = []
    for name in members("emaviz.page", "WORKSPACE"):
        found += classes_in(importlib.import_module(f"emaviz.page.{name}"), Tab)
    return sorted(found, key=lambda one: one.workspace.place)


# --- keys -------------------------------------------------------------------------------------------------------------
# Space plays, arrows step, digits change workspaces, Ctrl+Z takes a slider back; ? lists them as commands.

_MOST_DIGITS = 9
# viser's commands take no `?`, which here presses its own Ctrl+K; and an arrow that moves a focused slider or changes a
# tab is not to be a step as well.
_SCRIPT = """
(() => {
  window.emavizKeys?.();
  const typing = (at) => at.closest?.('input, textarea, select, [contenteditable=true]');
  const down = (event) => {
    if (event.key.startsWith('Arrow') && event.target.closest?.('[role=slider], [role=tab], [role=option]'))
      event.stopPropagation();
    if (event.key !== '?' || event.ctrlKey || event.metaKey || event.altKey || typing(event.target)) return;
    event.preventDefault();
    event.stopPropagation();
    const press = { key: 'k', code: 'KeyK', ctrlKey: true, bubbles: true, cancelable: true };
    document.body.dispatchEvent(new KeyboardEvent('keydown', press));
  };
  document.body.addEventListener('keydown', down);
  window.emavizKeys = () => document.body.removeEventListener('keydown', down);
})();
"""


def add_keys(page: Page, strip: PlaybackStrip, members: list[Workspace], undo: Callable[[], None]) -> None:
    """Registers them; in a field one types, and they do nothing.  undo(): on the screen's thread."""
    gui, post = page.server.gui, page.screen.post
    play = gui.add_command("Play or pause", hotkey="space", icon=viser.Icon.PLAYER_PLAY)
    play.on_trigger(lambda _: post("play", lambda: strip.play(not strip.playback.playing)))
    for title, key, steps, icon in (
        ("One step on", "arrowright", 1, viser.Icon.PLAYER_TRACK_NEXT),
        ("One step back", "arrowleft", -1, viser.Icon.PLAYER_TRACK_PREV),
    ):
        command = gui.add_command(title, hotkey=cast(Any, key), icon=icon)
        command.on_trigger(lambda _, steps=steps: post("step", lambda: strip.step(steps)))
    for digit, one in enumerate(members[:_MOST_DIGITS], 1):
        command = gui.add_command(f"Go to {one.title}", hotkey=cast(Any, str(digit)), icon=one.icon)
        command.on_trigger(lambda event, name=one.name: page.workspaces.go(name, event.client))
    back = gui.add_command("Undo on Explore", hotkey="Z", modifier="cmd/ctrl", icon=viser.Icon.ARROW_BACK_UP)
    back.on_trigger(lambda _: post("undo", undo))
    gui.add_command("List these keys: ?", icon=viser.Icon.KEYBOARD)
    Inside(page.server).run(_SCRIPT)


# --- the app: builds the page and joins it to the session -------------------------------------------------------------

_FASTEST_REDRAW_S = 0.04
_SLOW_REDRAW_S = 0.3  # of what nobody watches while dragging
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
        self.measuring = Measuring(lambda kind, job: self.screen.post(kind, job))
        self.server = open_server(
            host,
            port,
            self.door,
            lambda: self.viewer.address if self.viewer else None,
            data.scene,
            self.measuring.answer,
            lambda *asked: self.sharing.answer(*asked),
        )
        self.viewer, no_viewer = _viewer(recordings)
        self.session = Session(actuator, recordings)
        self.screen = Worker("emaviz-screen", self._on_screen_error, rest_s=_FASTEST_REDRAW_S)
        self._slow_screen = Worker("emaviz-slow-screen", self._on_screen_error, rest_s=_SLOW_REDRAW_S)
        self._files = Worker("emaviz-files", self._on_screen_error)
        self._docked = Docked(self.server)
        first = compare.WORKSPACE if given else explore.WORKSPACE
        self.workspaces = Workspaces(self.server, self.screen, self._docked, first.name)
        self.page = Page(self.server, self.session, self.screen, self.workspaces, self.measuring, data.folder)
        self.standings = Standings(self.screen, self.workspaces)
        self.sharing = Sharing(self.page, self.viewer)
        self.comparing = Comparing(self.session, data)
        self.session.open_file, self.session.version_of = self.comparing.measurement, self.comparing.version
        self.discovering = Discovering(self.session, self.comparing)
        self.campaigns = Campaigns(self.session, data, campaigns)
        self.sharing.files = self.campaigns.report
        self._build()
        self._first = threading.Event()
        self.first_picture_s = 0.0
        if not plant.can_be_explored(actuator):
            self._first.set()  # there will be no picture of a run
        events = self.session.events  # what tabs draw of a run is posted before
        self.screen.hear_any([events.simulated], lambda: self._drawn(started))
        events.told.connect(self.page.notify)
        self.session.start()
        for path in given:
            self.comparing.add(data.name_of(path))
        if no_viewer:
            self.server.on_client_connect(lambda _: self.page.notify("The Rerun viewer cannot be shown", no_viewer))
        elif self.door.token:
            self.server.on_client_connect(self._greet)

    def _build(self) -> None:
        gui, actuator = self.server.gui, self.session.actuator
        self._theme(dark=False)
        gui.set_panel_label("emaviz")
        gui.main_panel.dock_left()
        gui.main_panel.set_width(LEFT_PX)
        kinds = tabs()
        panels = [self.workspaces.add(one.workspace) for one in kinds]
        self.scene = ActuatorScene(self.server, round(actuator.motor.pole_pairs))
        self.strip = PlaybackStrip(self.page, self.scene, actuator, self._theme, self.sharing.connect)
        self.playback = self.strip.playback
        self.job_bar = JobBar(self.page, self._slow_screen)
        self.shared = Shared(
            self.page,
            self.strip,
            self.comparing,
            self.discovering,
            self.campaigns,
            self.viewer,
            Uploads(self.server, self.comparing.folder, lambda path: self.shared.take(path), self._refused),
            self._slow_screen,
            self._files,
            self.standings,
            self.sharing,
            Correction(self.page, self.discovering),
        )
        for kind, panel in zip(kinds, panels):
            self.shared.tabs[kind] = kind(self.shared, panel)
        self.sharing.tabs = {kind.workspace.name: one for kind, one in self.shared.tabs.items()}
        self._docked.dock()
        group = gui.add_tab_group()
        for kind, one in self.shared.tabs.items():
            with group.add_tab(kind.workspace.title, kind.workspace.icon):
                one.build()
        self.page.workspaces.entered.connect(self.shared.enter)
        self.shared.uploads.add_drop(",".join(self.shared.taken()))
        add_chart_tools(Inside(self.server))
        add_measuring(Inside(self.server))
        follow_theme(Inside(self.server))
        undo = self.tab(ExploreTab).panel.undo
        add_keys(self.page, self.strip, [kind.workspace for kind in kinds], undo)

    def tab(self, kind: type[AnyTab]) -> AnyTab:
        """One of the page's tabs."""
        return self.shared.tab(kind)

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
        self.job_bar.close()
        self.standings.close()
        for one in self.shared.tabs.values():
            one.close()
        self.discovering.close()
        self.comparing.close()
        self.session.close()
        self.screen.close()
        self._slow_screen.close()
        self._files.close()
        if self.viewer is not None:
            self.viewer.close()
        self.server.stop()

    def _drawn(self, started: float) -> None:
        if not self._first.is_set():
            self.first_picture_s = time.perf_counter() - started
            self._first.set()

    def _refused(self, line: str, button: Any) -> None:
        if button is not None:
            self.page.say_beside(button, line)
        elif line:
            self.page.notify("The file cannot be read", line)

    def _theme(self, dark: bool) -> None:
        self.server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=_BRAND, dark_mode=dark)

    def _greet(self, client: viser.ClientHandle) -> None:
        if not self.door.asked_here(Inside(self.server).headers(client.client_id)):
            client.add_notification("The Rerun viewer cannot be shown", f"{_NOT_FROM_ELSEWHERE}.", color="yellow")

    def _on_screen_error(self, error: BaseException) -> None:
        report(error, self.page.notify, "It cannot be done")


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
