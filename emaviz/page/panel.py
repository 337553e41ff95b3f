"""What tabs share: a job's line, files that stay, ways on, links to the viewer; and the job bar below all of them."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import viser

from ema_model.quantities import in_sentence
from ema_model.text import COLOURS, InWords
from emaviz.page.style import IN_ROW, JOBS, unseen
from emaviz.page.workspaces import Page, Workspace
from emaviz.recording.viewer import ViewerHost
from emaviz.server.viser_private import Inside, id_of
from emaviz.session.data_folder import DataFolder
from emaviz.session.files import Practice
from emaviz.session.jobs import AtWork, Ended, Job, Signal, Waiting, Worker
from emaviz.session.session_file import Provenance, ResultFiles
from emaviz.text import going_on
from emaviz.text.html import BOX, Html, add_html, boxed, html, joined
from emaviz.text.verdicts import begun, large, warned

# --- links to the Rerun viewer: a tab of its own is as light or dark as the page is when they are pressed -------------

LINK = "emaviz-viewer"  # their class
# Without it the viewer follows the system's theme.  A link is told on its way, so that what was drawn before the page
# changed is right as well: before a press of any button, of which one opens a tab and one a menu, or of Enter.
_SCRIPT = """
(() => {
  window.emavizLinks?.();
  const told = (event) => {
    const link = event.target.closest?.('a.LINK');
    if (!link) return;
    const address = new URL(link.href);
    const dark = document.documentElement.dataset.mantineColorScheme === 'dark';
    address.searchParams.set('theme', dark ? 'dark' : 'light');
    link.href = address;
  };
  const kinds = ['pointerdown', 'click'];
  for (const kind of kinds) document.addEventListener(kind, told, true);
  window.emavizLinks = () => { for (const kind of kinds) document.removeEventListener(kind, told, true); };
})();
"""


def follow_theme(inside: Inside) -> None:
    """In every page that is or will be open."""
    inside.run(_SCRIPT.replace("LINK", LINK))


def recording_link(viewer: ViewerHost | None, path: Path, text: str = "") -> Html:
    """A link that opens a recording in the Rerun viewer, or its name where there is none."""
    if viewer is None:
        return html('<div style="padding:2px 10px;font-size:13px">{}</div>', path.name)
    return html(
        '<div style="padding:2px 10px;font-size:13px;overflow-wrap:anywhere"><a class="{}" href="{}" '
        'target="_blank" rel="noopener">{}</a></div>',
        LINK,
        viewer.url_of(path.name),
        text or f"Open {path.name} in Rerun ↗",
    )


# --- what a long run says of itself: how far it is, what came of it, and the buttons that pause and stop it -----------


class JobLine:
    """A line of text; while the job runs, a bar, what goes on, and how long it still takes where that is known."""

    def __init__(self, page: Page, job: Job, at: Workspace, *, stop: str = "Stop", pauses: str = "") -> None:
        """at: to which the job bar leads; stop: the button's label.

        pauses: what its other button pauses, as in 'the search', or none.
        """
        page.job_tabs[job] = at.name
        self._page, self._job, self._pauses = page, job, pauses
        self._title = self._waited = ""
        self._stopping = self._refuses = False
        gui = page.server.gui
        self._pause = gui.add_button(
            f"Pause {pauses}", icon=viser.Icon.PLAYER_PAUSE, color="gray", visible=False, disabled=not pauses
        )
        self._stop = gui.add_button(stop, icon=viser.Icon.PLAYER_STOP, color="red", visible=False)
        self._bar = gui.add_progress_bar(100.0, animated=True, visible=False)
        self._text = add_html(gui)
        page.pressed(self._pause, lambda: job.pause(not job.paused))
        page.pressed(self._stop, self._ask_to_stop)
        hear = page.screen.hear
        hear(job.began, self._began, kind=self)
        hear(job.waits, self._waits)
        hear(job.progressed, self._goes_on)
        hear(job.rests, self._show_paused)
        hear(job.ended, self._ended, kind=self)

    def say(self, text: str, *, refuses: bool = False) -> None:
        """On the screen's thread; refuses: it says what is wrong with what is chosen, until something else is."""
        self._refuses = refuses
        self._text.content = boxed(text if isinstance(text, Html) else begun(self._page.local(text))) if text else ""

    def forget_refusal(self) -> None:
        """What was wrong is not chosen any more; whatever else is said stays."""
        if self._refuses:
            self.say("")

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
            failed = bool(self._job.error and not text)
            self.say(warned([self._job.error]) if failed else text, refuses=failed)


# --- a dropdown of the data folder's folders, read anew whenever its tab is entered -----------------------------------

_NONE = "–"


class FolderChoice:
    """The chosen folder stays as long as it is there; else the first one is taken."""

    def __init__(
        self,
        page: Page,
        label: str,
        hint: str,
        listed: Callable[[], dict[str, str]],
        chosen: Callable[[], str],
        take: Callable[[str], None],
    ) -> None:
        """listed(): names by title; chosen(): the one taken; take(name): another one, on the screen's thread."""
        self._listed, self._chosen, self._take_name = listed, chosen, take
        self._names: dict[str, str] = {}
        self.control: Any = page.server.gui.add_dropdown(label, (_NONE,), hint=hint)
        page.changed_to(self.control, self._take)  # as it is chosen now: the list may be about to be read again

    @property
    def empty(self) -> bool:
        """Whether there is none to choose."""
        return not self._names

    def refresh(self) -> None:
        """Reads the list again."""
        self._names = self._listed()
        options = tuple(self._names) or (_NONE,)
        if tuple(self.control.options) != options:
            self.control.options = options
        title = next((title for title, name in self._names.items() if name == self._chosen()), None)
        if title is not None:
            self.control.value = title
        elif self._names:
            self._take(options[0])

    def choose(self, name: str) -> None:
        """A folder by its name; on the screen's thread."""
        self.refresh()
        self._take(next(title for title, one in self._names.items() if one == name))

    def _take(self, title: str) -> None:
        name = self._names.get(title)
        if name is not None and self.control.value != title:
            self.control.value = title
        if name is not None and name != self._chosen():
            self._take_name(name)


# --- something that is shipped, which an empty screen runs at one click -----------------------------------------------

_EXAMPLE = (
    "font:inherit;font-weight:600;color:#fff;background:var(--mantine-primary-color-filled,#2f6fde);border:0;"
    "border-radius:4px;padding:5px 14px;cursor:pointer"
)


class Example:
    """Its button stands in what `begin` says of an empty screen."""

    def __init__(self, page: Page, title: str, about: str, run: Callable[[], object]) -> None:
        """run(): on the screen's thread; what it refuses is told to all."""
        pressed: Any = page.server.gui.add_button(title, color="gray")
        add_html(page.server.gui, unseen([id_of(pressed)]))
        page.pressed(pressed, lambda: page.checked(run))
        self.html = html(
            '<div style="padding-top:12px;display:flex;gap:12px;align-items:center">'
            '<button style="{};white-space:nowrap" onclick="window.emavizPress(\'{}\')">▶ {}</button>'
            '<span style="opacity:.75;font-size:13px;line-height:1.35">{}</span></div>',
            _EXAMPLE,
            id_of(pressed),
            title,
            about,
        )


# --- buttons that take what is shown to the workspace where one goes on with it ---------------------------------------


@dataclass(frozen=True)
class Lead:
    """take(): hands over what is shown, on the screen's thread; InputError says why that cannot be."""

    label: str
    icon: viser.IconName
    hint: str
    to: str  # the workspace's name
    take: Callable[[], Any]
    begins: Callable[[], bool] | None = None  # what begins there at once, as of `Page.begins`
    colour: Any = None


class Leads:
    """A button for each; the window that has asked goes along."""

    def __init__(self, page: Page, leads: Sequence[Lead]) -> None:
        self._page = page
        self.buttons = [self._add(one) for one in leads]

    def _add(self, lead: Lead) -> Any:
        button: Any = self._page.server.gui.add_button(lead.label, icon=lead.icon, hint=lead.hint, color=lead.colour)

        def follow(client: viser.ClientHandle | None) -> None:
            lead.take()
            self._page.workspaces.go(lead.to, client)
            if lead.begins is not None:
                self._page.begins(lead.begins, button)

        self._page.pressed_by(button, follow)
        return button


# --- buttons that keep what is shown in the data folder, and what they have written -----------------------------------
# Buttons that keep what is shown in the data folder, and what they have written; the browser saves it as well.


class Cleared(Protocol):
    """Forgets what it has said of files that were kept of what was shown before."""

    def clear(self) -> None:
        """To be called on the screen's thread."""


@dataclass(frozen=True)
class Keeps:
    """A button, and the file that it asks for."""

    label: str
    suffix: str
    icon: viser.IconName
    hint: str


REPORT = Keeps("Save report", ".html", viser.Icon.FILE_TEXT, "One HTML file that opens offline")
RECORD = Keeps("Record", ".rrd", viser.Icon.DEVICE_FLOPPY, "An .rrd file for the Rerun viewer")


class KeepButtons:
    """The buttons, and a line of the last file; a recording's line leads to the viewer."""

    def __init__(
        self,
        page: Page,
        folder: DataFolder,
        viewer: ViewerHost | None,
        kept: Signal[[Path]],
        save: Callable[[str, Any], object],
        provenance: Provenance,
        *buttons: Keeps,
    ) -> None:
        """save(suffix, button): asks for the file, for a link without a button; kept: it is written.

        provenance: of the result, which is written as it was computed.
        """
        self._page, self._provenance = page, provenance
        makes = [one.suffix for one in buttons if one in (REPORT, RECORD)]
        self._files = provenance.files = ResultFiles(
            makes, lambda: provenance.of, lambda suffix: page.ask((self, suffix), lambda: save(suffix, None))
        )
        self._folder, self._viewer, self._save = folder, viewer, save
        self._asked: viser.ClientHandle | None = None  # who is sent the file
        gui = page.server.gui
        add_html(gui, IN_ROW)
        for one in buttons:
            self.add(one)
        self._links = add_html(gui)
        page.screen.hear(kept, self._kept, each=lambda path: path.suffix)

    def add(self, one: Keeps) -> None:
        """One more button, where the page is being built."""
        button = self._page.server.gui.add_button(one.label, icon=one.icon, hint=one.hint)

        def save(client: viser.ClientHandle | None) -> None:
            self._asked = client
            self._save(one.suffix, button)

        self._page.pressed_by(button, save)

    def clear(self) -> None:
        """Something else is shown: what was kept before is told no more."""
        self._files.clear()
        self._links.content = ""

    def name(self, path: Path, text: str = "") -> None:
        """Where a file is kept, and what is to be said of it."""
        name = ", ".join(filter(None, (self._folder.name_of(path), self._provenance.note(), text)))
        self._links.content = html(
            '<div style="padding:2px 10px;font-size:13px">Also kept in the data folder: {}</div>', name
        )

    def said_at_once(self, path: Path) -> str:
        """What is to be said of a file that has just been written."""
        return ""

    def _kept(self, path: Path) -> None:
        if self._files.came(path):
            return
        if path.suffix == RECORD.suffix:
            self._links.content = recording_link(self._viewer, path)
            return
        self.name(path, self.said_at_once(path))
        if self._asked is not None:
            self._asked.send_file_download(path.name, path.read_bytes(), save_immediately=True)


# --- challenges on a tab: a button for each, the story of the one that is chosen, and its seal ------------------------


class PracticeButtons:
    """On the left.  chosen(name): called with the folder's name once its recordings are there, on the screen."""

    def __init__(self, page: Page, practice: Practice, chosen: Callable[[str], None]) -> None:
        self._practice = practice
        self._folder = ""
        gui = page.server.gui
        self._story = add_html(gui)
        with gui.add_folder("Challenges to practise on", expand_by_default=False):
            for one in practice.shipped:
                button = gui.add_button(
                    f"{one.title} {'●' * one.grade}{'○' * (5 - one.grade)}",
                    icon=viser.Icon.LOCK,
                    color="gray",
                    hint="Its recordings are made in the data folder, in some seconds",
                )
                page.pressed(button, partial(page.begins, partial(practice.open, one), button))
        page.screen.hear(practice.made, chosen)

    def show(self, folder: str) -> None:
        """The story of the challenge in a folder, if it holds one."""
        self._folder = folder
        one = self._practice.held(folder)
        self._story.content = "" if one is None else boxed(html("<b>{}.</b> {}", one.title, one.story))

    def fold(self) -> None:
        """The story gives way to a run and its result; a click on its title opens it."""
        one = self._practice.held(self._folder)
        if one is not None:
            told = '<details><summary style="cursor:pointer"><b>{}</b>: the story</summary>{}</details>'
            self._story.content = boxed(html(told, one.title, one.story))


class Seal:
    """On the right.  found(): what was found, of what the challenge is about."""

    def __init__(
        self, page: Page, practice: Practice, folder: Callable[[], str], found: Callable[[], InWords | None]
    ) -> None:
        self._practice, self._folder, self._found = practice, folder, found
        gui = page.server.gui
        self._place = gui.add_folder("The sealed truth", visible=False)
        with self._place:
            button = gui.add_button("Open the seal", icon=viser.Icon.LOCK_OPEN, color="gray")
            self._told = add_html(gui)
        page.pressed(button, self._open)

    def show(self) -> None:
        """Something else is shown: the seal is closed again."""
        self._place.visible = self._practice.held(self._folder()) is not None
        self._told.content = ""

    def _open(self) -> None:
        told = self._practice.reveal(self._folder(), self._found())
        lines = joined(html("<div>{}</div>", line) for line in told.lines)
        verdict = html("")
        if told.agrees is not None:
            verdict = large("The answer agrees.", "good") if told.agrees else large("The answer differs.", "bad")
        self._told.content = html("<div {}>{}{}</div>", BOX, verdict, lines)


# --- the job bar, along the bottom of every tab: what runs, how far it is, its Stop, and what waits -------------------

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
        page.pressed(self._stop, self._ask_to_stop, on=slow)
        for place, button in enumerate(self._places):
            page.pressed(button, partial(self._take_out, place), on=slow)
        slow.hear_any([self._jobs.changed], self._draw)

    def close(self) -> None:
        """Ends its clock."""
        if self._ends_at is not None:
            self._ends_at.cancel()

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
        self._slow.post("job bar", self._draw)

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
