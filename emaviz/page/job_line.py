"""What a long run says of itself: how far it is, what came of it, and the buttons that pause and stop it."""

from __future__ import annotations

import viser

from emaviz.page.page import Page
from emaviz.session.job import Job
from emaviz.text.html import Html, add_html
from emaviz.text.notes import boxed
from emaviz.text.sentence import begun
from emaviz.text.time_left import going_on
from emaviz.text.told import warned


class JobLine:
    """A line of text; while the job runs, a bar, what goes on, and how long it still takes where that is known."""

    def __init__(self, page: Page, job: Job, *, stop: str = "Stop", pauses: str = "") -> None:
        """stop: the button's label; pauses: what its other button pauses, as in 'the search', or none."""
        self._page, self._job, self._pauses = page, job, pauses
        self._title = self._waited = ""
        self._stopping = False
        gui = page.server.gui
        self._pause = gui.add_button(
            f"Pause {pauses}", icon=viser.Icon.PLAYER_PAUSE, color="gray", visible=False, disabled=not pauses
        )
        self._stop = gui.add_button(stop, icon=viser.Icon.PLAYER_STOP, color="red", visible=False)
        self._bar = gui.add_progress_bar(100.0, animated=True, visible=False)
        self._text = add_html(gui)
        self._name = f"job {id(self)}"
        post = page.screen.post
        self._pause.on_click(lambda _: post(f"{self._name} rests", lambda: job.pause(not job.paused)))
        self._stop.on_click(lambda _: post(f"{self._name} stops", self._ask_to_stop))
        job.began.connect(lambda title: post(self._name, lambda: self._began(title)))
        job.waits.connect(lambda text: post(f"{self._name} waits", lambda: self._waits(text)))
        job.progressed.connect(lambda *said: post(f"{self._name} goes on", lambda: self._goes_on(*said)))
        job.rests.connect(lambda rests: post(f"{self._name} is paused", lambda: self._show_paused(rests)))
        job.ended.connect(lambda text: post(self._name, lambda: self._ended(text)))

    def say(self, text: str) -> None:
        """On the screen's thread."""
        self._text.content = boxed(text if isinstance(text, Html) else begun(self._page.local(text))) if text else ""

    def _waits(self, text: str) -> None:
        """For its turn, and can be stopped before that has come; or, with no text, does not wait any more."""
        if self._job.running:
            return
        if self._job.waiting and text:
            self._stop.visible, self._stop.disabled, self._waited = True, False, text
            self.say(text)
        elif not self._job.waiting:
            self._stop.visible = False
            if self._waited and self._text.content == boxed(begun(self._waited)):  # nothing was said since
                self.say("")

    def _began(self, title: str) -> None:
        self._title, self._stopping = title, False
        with self._page.server.atomic():
            self._show_paused(False)
            self._stop.visible, self._stop.disabled = self._job.running, False
            self._bar.visible, self._pause.visible = self._job.running, self._job.running and bool(self._pauses)
            self._bar.value, self._bar.animated = 100.0, True
            ready = self._page.session.ready.is_set()
            self.say(f"{title} …" if ready else f"{title}: waiting until the models are compiled …")

    def _goes_on(self, text: str, seconds: float, share: float | None) -> None:
        if not self._job.running or self._stopping:
            return
        said = self._title if text == self._title else f"{self._title}: {text}"
        with self._page.server.atomic():
            self._bar.value, self._bar.animated = (100.0, True) if share is None else (100.0 * share, False)
            self.say(f"{said} … {going_on(seconds, share)}")

    def _show_paused(self, paused: bool) -> None:
        self._pause.label = f"{'Resume' if paused else 'Pause'} {self._pauses}"
        self._pause.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE

    def _ask_to_stop(self) -> None:
        self._job.stop()
        if self._job.running:
            self._stopping = self._stop.disabled = True
            self.say("Stopping after the present simulation …")
        else:  # it waited for its turn
            self._stop.visible = False
            self.say("Stopped.")

    def _ended(self, text: str) -> None:
        with self._page.server.atomic():
            self._stop.visible = self._pause.visible = self._bar.visible = False
            self.say(warned([self._job.error]) if self._job.error and not text else text)
