"""What a long run says of itself, with the button that stops it."""

from __future__ import annotations

import viser

from emaviz.page.discover.cards import note
from emaviz.page.page import Page
from emaviz.session.job import Job
from emaviz.text.html import add_html
from emaviz.text.time_left import going_on


class JobLine:
    """A line of text; while the job runs, what goes on and for how long."""

    def __init__(self, page: Page, job: Job) -> None:
        self._page, self._job = page, job
        self._text = add_html(page.server.gui)
        self._stop = page.server.gui.add_button("Stop", icon=viser.Icon.PLAYER_STOP, color="red", visible=False)
        self._stop.on_click(lambda _: job.stop())
        name = f"job {id(self)}"
        job.began.connect(lambda title: page.screen.post(name, lambda: self._goes_on(title, 0.0, None)))
        job.progressed.connect(lambda *said: page.screen.post(name, lambda: self._goes_on(*said)))
        job.ended.connect(lambda text: page.screen.post(name, lambda: self._ended(text)))

    def say(self, text: str) -> None:
        """On the screen's thread."""
        self._text.content = note(text) if text else ""

    def _goes_on(self, text: str, seconds: float, share: float | None) -> None:
        with self._page.server.atomic():
            self._stop.visible = self._job.running
            self.say(f"{text[:1].upper()}{text[1:]} … {going_on(seconds, share)}")

    def _ended(self, text: str) -> None:
        with self._page.server.atomic():
            self._stop.visible = False
            self.say(text)
