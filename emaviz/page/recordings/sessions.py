"""Everything on the page as one file: saved to the data folder and to the browser, loaded from either."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import viser

from ema_model.errors import InputError
from emaviz.figures.identified_table import Row
from emaviz.page.compare.tab import ComparePanel
from emaviz.page.explore.tab import ExplorePanel
from emaviz.page.identify.result import IdentifyResult
from emaviz.page.identify.tab import IdentifyPanel
from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.session import saved as session_file
from emaviz.session.actuators import UPLOADED
from emaviz.session.compare.comparing import Comparing
from emaviz.session.data_folder import SESSION_SUFFIX
from emaviz.session.discover.discovering import Discovering
from emaviz.session.saved import Part
from emaviz.session.worker import Worker
from emaviz.text.html import add_html, html

_NONE = "–"


def parts(
    page: Page,
    comparing: Comparing,
    strip: PlaybackStrip,
    explore: ExplorePanel,
    identify: IdentifyPanel,
    runs: IdentifyResult,
    compare: ComparePanel,
    discovering: Discovering,
) -> dict[str, Part]:
    """What a session's file holds, by name.  `restore` is called on the screen's thread."""

    def restore_settings(saved: Any, names: Mapping[str, str]) -> None:
        if isinstance(saved, dict) and saved.get("source"):
            saved = {**saved, "source": names.get(str(saved["source"]), saved["source"])}
        page.session.settings.restore(saved)
        explore.show_settings()
        identify.show_settings()

    def restore_runs(saved: Any, _: Mapping[str, str]) -> None:
        try:
            runs.show_rows([Row(**row) for row in saved])
        except TypeError:
            raise InputError("the session's table of runs is damaged; save it anew") from None

    def save_compare() -> dict[str, Any]:
        return {
            "files": list(comparing.opened),
            "actuator": comparing.actuator_name,
            "calibrate": comparing.calibrate,
            "free": sorted(comparing.free),
            "weights": comparing.weights,
            "window_s": comparing.window_s,
        }

    def restore_compare(saved: Any, names: Mapping[str, str]) -> None:
        try:
            actuator = str(saved["actuator"])
            if actuator.startswith(UPLOADED):
                name = actuator.removeprefix(UPLOADED)
                actuator = UPLOADED + names.get(name, name)
            comparing.choose_actuator(actuator)
            comparing.calibrate = bool(saved["calibrate"])
            for path in comparing.actuator.tolerances:
                comparing.set_free(path, path in saved["free"])
            comparing.weights = {}
            for name, weight in saved["weights"].items():
                comparing.set_weight(str(name), weight)
            comparing.window_s = None
            if saved["window_s"] is not None:
                comparing.set_window(*saved["window_s"])
            files = [names.get(str(name), str(name)) for name in saved["files"]]
        except (KeyError, TypeError, AttributeError):
            raise InputError("the session's part of Compare is damaged; save it anew") from None
        compare.asked.show_settings()
        for name in [name for name in comparing.opened if name not in files]:
            comparing.remove(name)
        for name in files:
            comparing.add(name)

    return {
        "settings": Part(page.session.settings.saved, restore_settings),
        "runs": Part(lambda: [asdict(row) for row in runs.rows], restore_runs),
        "compare": Part(save_compare, restore_compare),
        "discovery": Part(discovering.saved, discovering.restore, discovering.files),
        "look": Part(strip.saved, lambda saved, _: strip.restore(saved)),
    }


class SessionControls:
    """Save, and load; files are packed on the worker `files`, controls are set on the screen's thread."""

    def __init__(self, page: Page, comparing: Comparing, files: Worker, kept: Mapping[str, Part]) -> None:
        """kept: the parts of the page."""
        self._page, self._comparing, self._files, self._parts = page, comparing, files, kept
        gui = page.server.gui
        with gui.add_folder("Session: everything on the page"):
            self._name = gui.add_text("Session name", f"session-{datetime.now():%Y%m%d}")
            save = gui.add_button("Save session", icon=viser.Icon.DEVICE_FLOPPY, hint="To the data folder, and here")
            self._choice: Any = gui.add_dropdown("Saved", (_NONE,))
            self._load = gui.add_button("Load session", icon=viser.Icon.FOLDER_OPEN, color="gray", disabled=True)
            add_html(
                gui,
                html(
                    '<div style="font-size:12px;opacity:.75;padding:0 10px">A {} file from elsewhere: drop '
                    "it anywhere on the page.</div>",
                    SESSION_SUFFIX,
                ),
            )
        save.on_click(lambda event: self._post("save session", lambda: self._save(event.client)))
        self._load.on_click(lambda _: self._load_named(str(self._choice.value)))
        self.refresh()

    def refresh(self) -> None:
        """Reads the folder's list again."""
        names = self._comparing.folder.session_files()
        self._choice.options = names or [_NONE]
        self._choice.value = (names or [_NONE])[0]
        self._load.disabled = not names

    def uploaded(self, path: Path) -> None:
        """A session came from the browser; on any thread."""
        self._page.screen.post("load session", lambda: self._read(path))

    def _load_named(self, name: str) -> None:
        def read() -> None:
            self._read(self._comparing.folder.session(name))

        self._page.screen.post("load session", partial(self._checked, read))

    def _save(self, client: viser.ClientHandle | None) -> None:
        folder = self._comparing.folder
        path = session_file.free_path(folder, self._name.value)
        session_file.write(path, self._parts, folder, self._needed())
        self.refresh()
        self._page.notify("Session saved", folder.name_of(path), "green")
        if client is not None:
            client.send_file_download(path.name, path.read_bytes(), save_immediately=True)

    def _needed(self) -> list[str]:
        """Names of the files that the page shows or uses."""
        names = [*self._comparing.opened, self._page.session.settings.source]
        if self._comparing.actuator_name.startswith(UPLOADED):
            names.append(self._comparing.actuator_name.removeprefix(UPLOADED))
        names += [name for part in self._parts.values() for name in part.files()]
        return [name for name in names if name]

    def _read(self, path: Path) -> None:
        def take() -> None:
            session_file.read(path, self._parts, self._comparing.folder)

        if self._page.checked(take):
            self._page.notify("Session loaded", path.name, "green")
        self.refresh()

    def _post(self, kind: str, job: Callable[[], None]) -> None:
        self._files.post(kind, partial(self._checked, job))

    def _checked(self, job: Callable[[], None]) -> None:
        """What is refused is told."""
        self._page.checked(job)
