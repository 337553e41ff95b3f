"""The job bar, along the bottom of every tab: what runs, how far it is, its Stop, and what waits."""

from __future__ import annotations

import json
import threading
from typing import Any

import viser

from ema_model.quantities import in_sentence
from ema_model.text import COLOURS
from emaviz.page.style import JOBS
from emaviz.page.workspaces import Page
from emaviz.session.jobs import AtWork, Ended, Job, Waiting, Worker
from emaviz.text.html import Html, add_html, html, joined
from emaviz.text.results import begun
from emaviz.text.time_left import going_on

_SHOWN_AFTER_S = 0.6  # what is quicker is over before one could read it
_TOLD_S = 10.0  # for which the end of a run stands there
_MOST_WAITING = 4  # that have a button


class JobBar:
    """Drawn on the slow screen's thread, a few times a second."""

    def __init__(self, page: Page, slow: Worker) -> None:
        self._page, self._slow, self._jobs = page, slow, page.session.worker.jobs
        self._told_end: Ended | None = None  # the last end that was told
        self._seen: Job | None = None  # the run that goes on, once it was shown
        self._stopping: Job | None = None
        self._ends_at: threading.Timer | None = None
        self._ending = False  # whether the end of a run is shown
        self._waiting: tuple[Waiting, ...] = ()
        gui = page.server.gui
        self._panel = gui.add_panel(visible=False)
        with self._panel.add_tab("Jobs", viser.Icon.PLAYER_PLAY):
            add_html(gui, JOBS)
            self._told = add_html(gui)
            self._stop: Any = gui.add_button("Stop this run", icon=viser.Icon.PLAYER_STOP, color="red")
            self._then = add_html(gui)
            self._places: list[Any] = [
                gui.add_button("–", icon=viser.Icon.X, color="gray", visible=False, hint="Takes it out of the line")
                for _ in range(_MOST_WAITING)
            ]
        self._panel.float(x=0, y=-1, width=480)
        self._stop.on_click(lambda _: self._slow.post("job bar stops", self._ask_to_stop))
        for place, button in enumerate(self._places):
            button.on_click(lambda _, place=place: self._slow.post("job bar line", lambda: self._take_out(place)))
        self._jobs.changed.connect(self._soon)

    def close(self) -> None:
        """Ends its clock."""
        if self._ends_at is not None:
            self._ends_at.cancel()

    def _soon(self) -> None:
        self._slow.post("job bar", self._draw)

    # --- what is pressed --------------------------------------------------------------------------------------------

    def _ask_to_stop(self) -> None:
        running = self._jobs.running
        if running is not None:
            self._stopping = running.job
            running.job.stop()
            self._draw()

    def _take_out(self, place: int) -> None:
        if place < len(self._waiting):
            self._jobs.remove(self._waiting[place])
        self._draw()

    # --- what is shown ----------------------------------------------------------------------------------------------

    def _draw(self) -> None:
        running, waiting = self._jobs.running, self._jobs.waiting
        if running is not None and (running.elapsed_s >= _SHOWN_AFTER_S or waiting):
            self._seen, self._ending = running.job, False
        elif running is None:
            self._end()
        with self._page.server.atomic():
            seen = running is not None and running.job is self._seen
            if running is not None and seen:
                self._told.content = self._going_on(running)
            self._stop.visible = seen
            self._stop.disabled = running is not None and running.job is self._stopping
            self._show_waiting(waiting)
            self._panel.visible = seen or self._ending or bool(waiting)

    def _end(self) -> None:
        """What came of the run that was shown, for a while."""
        ended, seen = self._jobs.ended, self._seen
        self._seen = self._stopping = None
        if ended is None or ended is self._told_end:
            return
        self._told_end = ended
        if ended.job is not seen:
            return
        self._ending = True
        how = "Failed" if ended.job.error else "Stopped" if ended.stopped else "Done"
        good = how == "Done"
        sign = html('<span style="color:{}">{}</span>', COLOURS["good" if good else "warning"], "✓" if good else "▲")
        said = html("<b>{}: {}</b>", how, in_sentence(ended.title))
        self._told.content = _line(sign, said, self._way(ended.job, "Show"))
        self.close()
        self._ends_at = threading.Timer(_TOLD_S, self._forget_end)
        self._ends_at.daemon = True
        self._ends_at.start()

    def _forget_end(self) -> None:
        self._ending = False
        self._soon()

    def _going_on(self, at: AtWork) -> Html:
        title = self._way(at.job, at.job.title)
        text = "" if at.text == at.job.title else begun(at.text)
        state = "stopping …" if at.job is self._stopping else "paused" if at.job.paused else ""
        return _line(_bar(at.share), title, html("<span>{}</span>", text), state or going_on(at.elapsed_s, at.share))

    def _way(self, job: Job, text: str) -> Html:
        """A link to the job's tab; told by the pointer going down, since it may be drawn anew before that goes up."""
        tab = self._page.job_tabs.get(job)
        if tab is None:
            return html("<b>{}</b>", text)
        go = f"window.emavizViews?.go({json.dumps(tab)})"
        return html('<a role="button" tabindex="0" onpointerdown="{}" onclick="{}"><b>{}</b></a>', go, go, text)

    def _show_waiting(self, waiting: tuple[Waiting, ...]) -> None:
        self._waiting = waiting[:_MOST_WAITING]
        more = len(waiting) - _MOST_WAITING
        self._then.content = html("<span>then{}</span>", f" ({more} more)" if more > 0 else "") if waiting else ""
        for place, button in enumerate(self._places):
            one = self._waiting[place] if place < len(self._waiting) else None
            if one is not None and button.label != one.title:
                button.label = one.title
            if button.visible != (one is not None):
                button.visible = one is not None


def _bar(share: float | None) -> Html:
    if share is None:
        return Html('<i class="emaviz-job-share"><i class="emaviz-job-unknown"></i></i>')
    return html('<i class="emaviz-job-share"><i style="width:{:.1f}%"></i></i>', 100.0 * min(max(share, 0.0), 1.0))


def _line(*parts: str) -> Html:
    return html('<div class="emaviz-job" role="status">{}</div>', joined(one for one in parts if one))
