"""Everything on the page as one file: saved to the data folder and to the browser, loaded from either."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import viser

from emaviz.page.page import Page
from emaviz.session import saved as session_file
from emaviz.session.actuators import UPLOADED
from emaviz.session.compare.comparing import Comparing
from emaviz.session.data_folder import SESSION_SUFFIX
from emaviz.session.saved import Part
from emaviz.session.worker import Worker
from emaviz.text.html import add_html, html, joined
from emaviz.text.notes import boxed

_NONE = "–"


class SessionControls:
    """Save, and load; files are packed on the worker `files`, controls are set on the screen's thread."""

    def __init__(
        self,
        page: Page,
        comparing: Comparing,
        files: Worker,
        kept: Callable[[], Mapping[str, Part]],
        lacking: Callable[[], Mapping[str, str]],
    ) -> None:
        """kept(): the parts of the page; lacking(): what each tab has to compute again, by its title."""
        self._page, self._comparing, self._files, self._kept = page, comparing, files, kept
        self._lacking = lacking
        gui = page.server.gui
        with gui.add_folder("Session: everything on the page"):
            self._name = gui.add_text("Session name", f"session-{datetime.now():%Y%m%d}")
            self._save_it = gui.add_button(
                "Save session", icon=viser.Icon.DEVICE_FLOPPY, hint="To the data folder, and here"
            )
            self._choice: Any = gui.add_dropdown("Saved", (_NONE,))
            self._load = gui.add_button("Load session", icon=viser.Icon.FOLDER_OPEN, color="gray", disabled=True)
            self._loaded = add_html(gui)
            add_html(
                gui,
                html(
                    '<div style="font-size:12px;opacity:.75;padding:0 10px">A {} file from elsewhere: drop '
                    "it anywhere on the page.</div>",
                    SESSION_SUFFIX,
                ),
            )
        self._save_it.on_click(lambda event: self._post("save session", lambda: self._save(event.client)))
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
        self._page.ask("load session", lambda: self._read(path), self._load)

    def _load_named(self, name: str) -> None:
        self._page.ask("load session", lambda: self._read(self._comparing.folder.session(name)), self._load)

    def _save(self, client: viser.ClientHandle | None) -> None:
        folder = self._comparing.folder
        path = session_file.free_path(folder, self._name.value)
        session_file.write(path, self._kept(), folder, self._needed())
        self.refresh()
        self._page.notify("Session saved", folder.name_of(path), "green")
        if client is not None:
            client.send_file_download(path.name, path.read_bytes(), save_immediately=True)

    def _needed(self) -> list[str]:
        """Names of the files that the page shows or uses."""
        names = [*self._comparing.opened, self._page.session.settings.source]
        if self._comparing.actuator_name.startswith(UPLOADED):
            names.append(self._comparing.actuator_name.removeprefix(UPLOADED))
        names += [name for part in self._kept().values() for name in part.files()]
        return [name for name in names if name]

    def _read(self, path: Path) -> None:
        try:
            session_file.read(path, self._kept(), self._comparing.folder)
        finally:
            self.refresh()
        lines = self._lacking()
        told = [html("<div><b>{}.</b> {}</div>", title, line) for title, line in lines.items()]
        begun = html("<div>{} is loaded{}</div>", path.name, ":" if told else ", with all its results.")
        self._loaded.content = boxed(joined([begun, *told]))
        said = "; ".join(f"{title}: {line[:1].lower()}{line[1:].rstrip('.')}" for title, line in lines.items())
        self._page.notify("Session loaded", f"{path.name}. {said}" if said else path.name, "green")

    def _post(self, kind: str, job: Callable[[], None]) -> None:
        def checked() -> None:
            self._page.checked(job, self._save_it)

        self._files.post(kind, checked)
