"""A button of Explore: what is hidden in its plant becomes a sealed challenge for somebody else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import viser

from emaviz.page.job_line import JobLine
from emaviz.page.page import Page
from emaviz.session.discover.sealing import Sealing

_TEXT = (
    "The plant as it is set here, its hidden effects and faults, is recorded four times: a chirp, a small step, a slow "
    "sine, and a sine to hold out. Its parameters are off within their tolerances, at random. The load and the noise "
    "are those set here; perfect sensors are replaced by those of a usual rig. The story and the measurements can be "
    "read, the answer only by *Reveal* on the Discover tab."
)


class SealControls:
    """The button, the questions, and the file that is sent to who has asked."""

    def __init__(self, page: Page, sealing: Sealing) -> None:
        self._page, self._sealing = page, sealing
        self._asked: viser.ClientHandle | None = None
        gui = page.server.gui
        self._button = gui.add_button(
            "Seal as a challenge…", icon=viser.Icon.LOCK, color="gray", hint="One file for a colleague to solve"
        )
        JobLine(page, sealing.job)
        self._button.on_click(lambda event: self._ask(event.client))
        sealing.job.began.connect(lambda _: page.screen.post("sealing", lambda: self._busy(True)))
        sealing.job.ended.connect(lambda _: page.screen.post("sealing", lambda: self._busy(False)))
        sealing.sealed.connect(lambda path: page.screen.post("sealed", lambda: self._sealed(path)))

    def _ask(self, client: viser.ClientHandle | None) -> None:
        if client is None:
            return
        modal = client.gui.add_modal("Seal as a challenge")
        with modal:
            client.gui.add_markdown(_TEXT)
            title = client.gui.add_text("Challenge title", "")
            story = client.gui.add_text("Its story", "", multiline=True, hint="What a colleague should know, not more")
            seal = client.gui.add_button("Seal it", icon=viser.Icon.LOCK)
            client.gui.add_button("Cancel", color="gray").on_click(lambda _: modal.close())

        def begin() -> None:
            self._begin(client, str(title.value), str(story.value), seal, modal.close)

        seal.on_click(lambda _: self._page.screen.post("seal", begin))

    def _begin(
        self, client: viser.ClientHandle, title: str, story: str, button: Any, close: Callable[[], None]
    ) -> None:
        if self._page.begins(lambda: self._sealing.seal(title, story), button):
            self._asked = client
            close()

    def _busy(self, busy: bool) -> None:
        self._button.disabled = busy

    def _sealed(self, path: Path) -> None:
        self._page.notify("Challenge sealed", f"{path.name}: Discover lists it among the measurements.", "green")
        if self._asked is not None:
            self._asked.send_file_download(path.name, path.read_bytes(), save_immediately=True)
