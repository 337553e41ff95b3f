"""The Runs tab: recordings, two beside each other, sessions."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.errors import InputError
from ema_model.faults import HEALTHY
from ema_model.recordings import SIGNALS, Measurement
from emaviz.figures import comparison, runs
from emaviz.figures.identification import named
from emaviz.figures.lines import Lines, Window, clipped
from emaviz.page.campaigns import CampaignControls
from emaviz.page.charts import marked
from emaviz.page.panel import Example, recording_link
from emaviz.page.share import Place, share_line
from emaviz.page.tab import Shared, Tab
from emaviz.page.window_layout import COLUMNS
from emaviz.page.workspaces import Page, Workspace
from emaviz.recording.entry import Entry, error_said, setting
from emaviz.recording.read import Recording
from emaviz.recording.viewer import ViewerHost
from emaviz.scene.playback import motion
from emaviz.session import session_file
from emaviz.session.compare import Comparing
from emaviz.session.data_folder import SESSION_SUFFIX
from emaviz.session.files import UPLOADED, RecordedRuns
from emaviz.session.jobs import Worker
from emaviz.session.session_file import Part
from emaviz.text.html import Html, add_html, begin, boxed, explained, html, joined, said

# --- everything on the page as one file: saved to the data folder and to the browser, loaded from either --------------

WORKSPACE = Workspace("runs", "Runs", viser.Icon.LIST, 9, share=0.66)  # for the Rerun viewer

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
        self._page, self._comparing, self._kept, self._lacking = page, comparing, kept, lacking
        gui = page.server.gui
        with gui.add_folder("Session: everything on the page"):
            self._name = gui.add_text("Session name", f"session-{datetime.now():%Y%m%d}")
            save = gui.add_button("Save session", icon=viser.Icon.DEVICE_FLOPPY, hint="To the data folder, and here")
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
        page.pressed_by(save, self._save, on=files)
        self._load.on_click(lambda _: self._load_named(str(self._choice.value)))  # as it is chosen when it is pressed
        self.refresh()

    def refresh(self, newest: bool = True) -> None:
        """Reads the folder's list again; newest: chooses that one, and not what is chosen as long as it is there."""
        names, chosen = self._comparing.folder.session_files(), str(self._choice.value)
        self._choice.options = names or [_NONE]
        self._choice.value = chosen if chosen in names and not newest else (names or [_NONE])[0]
        self._load.disabled = not names

    def uploaded(self, path: Path) -> None:
        """A session came from the browser; on any thread."""
        self._page.ask("load session", lambda: self._read(path), self._load)

    def _load_named(self, name: str) -> None:
        self._page.ask("load session", lambda: self._read(self._comparing.folder.session(name)), self._load)

    def _save(self, client: viser.ClientHandle | None) -> None:
        folder = self._comparing.folder
        path = session_file.free_path(folder, self._name.value)
        session_file.write_session(path, self._kept(), folder, self._needed())
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
            session_file.read_session(path, self._kept(), self._comparing.folder)
        finally:
            self.refresh()
        lines = self._lacking()
        told = [html("<div><b>{}.</b> {}</div>", title, line) for title, line in lines.items()]
        begun = html("<div>{} is loaded{}</div>", path.name, ":" if told else ", with all its results.")
        self._loaded.content = boxed(joined([begun, *told]))
        said = "; ".join(f"{title}: {line[:1].lower()}{line[1:].rstrip('.')}" for title, line in lines.items())
        self._page.notify("Session loaded", f"{path.name}. {said}" if said else path.name, "green")


# --- the Runs tab's panel on the right: the Rerun viewer in the page, and two recordings on the same axes -------------

_CONFIG = {"displayModeBar": False}
_STEPS = (
    Html("Identify something, or press <b>Record</b> below a comparison or a discovery."),
    "Choose the run on the left: you see what it found, and its current.",
    "Open it in Rerun, on this page or in a tab of its own, or lay two runs over each other.",
)
_EXAMPLE = "Run an example", "Faults on Explore's sliders are identified; the search is recorded, and stands here then."


class RunsResult:
    """Called on the files' thread."""

    def __init__(self, page: Page, panel: viser.PanelHandle) -> None:
        self._page = page
        self._pair: tuple[tuple[Entry, Any], tuple[Entry, Any]] | None = None
        self._window: Window | None = None  # of time, in which the pair is shown
        self._shown: Recording | None = None  # the chosen run
        self._plot: Any = None
        self.run_example: Callable[[], object] = lambda: None  # records something
        self._drawn = False  # of the chosen run
        self._opened, self._dark = ("", ""), False  # the viewer's address and recording; whether the page is dark
        self._tab = panel.add_tab("Rerun", viser.Icon.PLAYER_PLAY)
        gui = page.server.gui
        with self._tab:
            example = Example(page, *_EXAMPLE, lambda: self.run_example())
            self._told = self._nothing = begin("Nothing is recorded yet", _STEPS, example.html)
            self._frame = add_html(gui, self._nothing)
            self._glance: Any = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=0.5, visible=False)
            self._close = gui.add_button("Close the viewer", icon=viser.Icon.X, color="gray", visible=False)
        with panel.add_tab("Two runs", viser.Icon.ARROWS_DIFF):
            add_html(gui, COLUMNS)
            self._names = add_html(gui, _hint("Choose two on the left."))
            self._signals: dict[str, str] = {}
            self._signal: Any = gui.add_dropdown("Signal", ("–",), visible=False)
            self._place = gui.add_folder("Signals and search", visible=False)
            self._table = add_html(gui)
        page.measuring.add_rows(self._glance, 2, self._glance_lines, self._zoom_glance)
        page.pressed(self._close, self.close_viewer)
        page.changed(self._signal, self._draw)

    def set_dark(self, dark: bool) -> None:
        """The page is dark from now on, or light; a viewer that is open is loaded anew."""
        self._dark = dark
        if self._close.visible:
            self.open(*self._opened)

    def open(self, url: str, name: str) -> None:
        """The viewer with a recording, in the page, as light or dark as that is."""
        self._opened = url, name
        url += f"&theme={'dark' if self._dark else 'light'}"
        self._frame.content = share_line(WORKSPACE.name, {"run": [name]}) + html(
            '<div class="emaviz-viewer"><div><b>{}</b> · <button onclick="{}"><span>over the whole window ⤢</span>'
            '<span>back to the page ⤡</span></button> · <a href="{}" target="_blank" rel="noopener">in a tab of its '
            'own ↗</a></div><iframe class="emaviz-rerun" src="{}" title="Rerun viewer"></iframe></div>',
            name,
            "this.closest('.emaviz-viewer').classList.toggle('emaviz-whole')",
            url,
            url,
        )
        self._close.visible, self._glance.visible = True, False

    def show(self, told: Html, recording: Recording | None) -> None:
        """The chosen run, where the viewer is not open: what is said of it, and its current; None for none."""
        self._shown = recording
        self._told, self._drawn = told or self._nothing, self._draw_glance(None)
        if not self._close.visible:
            self._frame.content, self._glance.visible = self._told, self._drawn

    def _draw_glance(self, window_s: Window | None) -> bool:
        """Whether there is something to draw."""
        figure = comparison.one_recording(self._shown, window_s=window_s) if self._shown is not None else None
        if figure is not None:
            self._glance.figure = marked(figure, self._glance, rows=2)
        return figure is not None

    def _glance_lines(self, place: int) -> Lines | None:
        signal = comparison.signal_at_a_glance(self._shown) if self._shown is not None else None
        if self._shown is None or signal is None:
            return None
        found = runs.recorded([("", "", self._shown)], signal)[place]
        return found if found.lines else None

    def _zoom_glance(self, window_s: Window | None) -> None:
        one = self._glance_lines(0)
        if one is not None:
            self._draw_glance(clipped(window_s, one.every_time_s))

    def close_viewer(self) -> None:
        """Takes the viewer off the page, which frees its memory."""
        self._close.visible = False
        self._frame.content, self._glance.visible = self._told, self._drawn

    def compare(self, first: tuple[Entry, Any], second: tuple[Entry, Any]) -> None:
        """Two recordings, each as an entry and what was read of it."""
        self._pair, self._window = (first, second), None
        names = runs.signals(first[1], second[1]) or ["current_A"]
        self._signals = {SIGNALS[name].title: name for name in names}
        titles = {name: title for title, name in self._signals.items()}
        self._signal.options = tuple(self._signals)
        self._signal.value = titles.get("current_A") or next(iter(self._signals))
        self._signal.visible = self._place.visible = True
        self._names.content = _hint(
            html(
                '<b style="color:{}">A</b> {}<br><b style="color:{}">B</b> {}',
                runs.FIRST,
                first[0].name,
                runs.SECOND,
                second[0].name,
            )
        )
        self._draw()
        self._table.content = runs.two_recordings_table(first[0], second[0])

    def _chosen(self) -> str:
        return self._signals.get(str(self._signal.value), "current_A")

    def _lines(self, place: int) -> Lines | None:
        if self._pair is None:
            return None
        (_, first), (_, second) = self._pair
        found = runs.recorded([("A", runs.FIRST, first), ("B", runs.SECOND, second)], self._chosen())[place]
        return found if found.lines else None

    def _zoom(self, window_s: Window | None) -> None:
        one = self._lines(0)
        if one is not None:
            self._window = clipped(window_s, one.every_time_s)
            self._draw()

    def _draw(self) -> None:
        if self._pair is None:
            return
        (_, first), (_, second) = self._pair
        figure = runs.two_recordings(first, second, self._chosen(), window_s=self._window)
        if self._plot is None:
            with self._place:
                self._plot = self._page.server.gui.add_plotly(figure, config=_CONFIG, aspect=1.1)
            self._page.measuring.add_rows(self._plot, 2, self._lines, self._zoom)
        self._plot.figure = marked(figure, self._plot, rows=2)


def _hint(text: str) -> Html:
    return html('<div style="padding:8px 12px;font-size:13px;opacity:.8">{}</div>', text)


# --- the Runs tab: past runs (.rrd) with what they were and what they found; reopen, rename, delete, compare ----------

NONE = "–"
_SHOWN = 25
_LOOK_S = 2.0  # between two looks at the folder
_UNSET = ("", "none", None, "0", "0.0", 0)  # settings that say that there is nothing of the kind, are not listed
_BOX = Html('style="padding:2px 10px;font-size:12.5px;line-height:1.45"')


class RunsPanel:
    """The tab's controls.  `result` is the panel on the right; files are read on the worker `files`."""

    def __init__(
        self, page: Page, viewer: ViewerHost | None, recorded: RecordedRuns, files: Worker, result: RunsResult
    ) -> None:
        self._page, self._viewer, self._recorded = page, viewer, recorded
        self._files, self._result = files, result
        self._by_hand = False  # chosen; else the newest is shown
        self._growing = ""  # a run that is followed while it is being written
        self._seen: tuple[str, datetime] | None = None  # which is shown at a glance
        gui = page.server.gui
        self._choice: Any = gui.add_dropdown("Run", (NONE,))
        self._card = add_html(gui, _empty("None yet: identify something, or record a comparison or a discovery."))
        self._open = gui.add_button("Open in Rerun, here", icon=viser.Icon.PLAYER_PLAY, disabled=True)
        self._link = add_html(gui)
        with gui.add_folder("Compare two"):
            self._other: Any = gui.add_dropdown("With", (NONE,))
            self._compare = gui.add_button("Overlay both runs", icon=viser.Icon.ARROWS_DIFF, disabled=True)
        with gui.add_folder("Rename or delete", expand_by_default=False):
            self._name = gui.add_text("New name", "")
            self._rename = gui.add_button("Rename", icon=viser.Icon.PENCIL, color="gray", disabled=True)
            self._delete = gui.add_button("Delete…", icon=viser.Icon.TRASH, color="red", disabled=True)
        with gui.add_folder("All, newest first"):
            self._list = add_html(gui)
            again = gui.add_button("Refresh the list", icon=viser.Icon.REFRESH, color="gray")
        page.changed_to(self._choice, self._take_choice, on=files)  # the list may be about to be read again
        page.pressed(self._open, self._open_chosen, on=files)
        page.pressed(self._compare, self._compare_two, on=files)
        page.pressed(self._rename, self._rename_chosen, on=files)
        page.pressed_by(self._delete, self._ask)
        page.pressed(again, partial(page.checked, self.refresh, self._choice), on=files)
        page.session.identifying.identified.connect(lambda _: self.refresh_soon())
        page.workspaces.entered.connect(lambda name: name == WORKSPACE.name and self.refresh_soon())
        threading.Thread(target=self._watch, name="emaviz-runs", daemon=True).start()
        self.refresh_soon()

    def _watch(self) -> None:
        """Another program's runs are seen, too, while somebody looks."""
        known: list[str] = []
        while not self._files.closing:
            time.sleep(_LOOK_S)
            if self._page.workspaces.anyone(WORKSPACE.name) and (names := self._recorded.names()) != known:
                known = names
                self.refresh_soon()

    def refresh_soon(self) -> None:
        """Reads the folder again; from any thread."""
        self._post(self.refresh)

    # --- on the files' thread ---------------------------------------------------------------------------------------

    def choose(self, name: str) -> None:
        """Shows a recording, and opens it."""
        self._choice.options = self._recorded.names()
        self._choice.value, self._by_hand = name, True
        self.refresh()
        self._open_chosen()

    def check(self, name: str) -> None:
        """InputError where there is no such recording."""
        self._recorded.path(name)

    def follow(self, url: str, name: str) -> None:
        """Shows a run while it is being written; the list has it from now on."""
        self._growing, self._by_hand = name, True
        self._choice.options = [name, *(one for one in self._recorded.names() if one != name)]
        self._choice.value = name
        self.refresh()
        self._result.open(url, name)

    def refresh(self) -> None:
        """Reads the folder again."""
        names = self._recorded.names()
        if self._viewer is None or self._growing in names or self._viewer.find_growing(self._growing) is None:
            self._growing = ""
        names = [*([self._growing] if self._growing else []), *names]
        if not self._by_hand or self._choice.value not in names:
            self._by_hand, chosen = False, (names or [NONE])[0]
        else:
            chosen = self._choice.value
        if list(self._choice.options) != (names or [NONE]):
            self._choice.options = names or [NONE]
        self._choice.value = chosen
        entries = self._entries(names[:_SHOWN])
        more = html("<div {}>… and {} more</div>", _BOX, len(names) - _SHOWN) if len(names) > _SHOWN else ""
        self._list.content = _listed(entries) + more
        self._show_chosen()

    def _take_choice(self, name: str) -> None:
        self._by_hand = True
        if name in self._choice.options:
            self._choice.value = name
        self._show_chosen()

    def _offer_others(self) -> None:
        """A run is compared with another one, which stays chosen as long as it is one."""
        others = [name for name in self._choice.options if name != self._choice.value] or [NONE]
        if list(self._other.options) != others:
            other = self._other.value
            self._other.options = others
            self._other.value = other if other in others else others[0]
        self._compare.disabled = others == [NONE]

    def _entries(self, names: list[str]) -> list[Entry]:
        entries = []
        for name in names:
            try:
                entries.append(self._recorded.entry(name))
            except InputError:  # gone since it was listed
                continue
        return entries

    def _show_chosen(self) -> None:
        name = str(self._choice.value)
        growing = bool(name) and name == self._growing
        exists = name != NONE and not growing
        self._open.disabled = not exists or self._viewer is None
        self._rename.disabled = self._delete.disabled = not exists
        self._offer_others()
        if growing:
            self._card.content, self._link.content = _empty("It is being written; what it found comes at its end."), ""
            return
        if not exists:
            self._card.content, self._link.content = _empty("None yet."), ""
            self._result.show(Html(), None)
            return
        entry = self._recorded.entry(name)
        self._card.content = html("<div {}>{}</div>", _BOX, _size(entry))  # what it says stands on the right
        self._glance(entry)
        self._link.content = recording_link(self._viewer, self._recorded.path(name))
        self._name.value = name.removesuffix(".rrd")

    def _glance(self, entry: Entry) -> None:
        """The chosen run on the right, once somebody looks."""
        if (entry.name, entry.at) == self._seen or not self._page.workspaces.anyone(WORKSPACE.name):
            return
        self._seen = entry.name, entry.at
        links = share_line(WORKSPACE.name, {"run": [entry.name]})
        told = links + html(
            '<div style="padding:8px 10px 2px;font-size:14px"><b>{}</b></div>{}', entry.name, _card(entry)
        )
        try:
            self._result.show(told, self._recorded.read(entry.name))
        except InputError:  # it is not whole
            self._result.show(told, None)

    def _open_chosen(self) -> None:
        if self._viewer is not None:
            name = self._recorded.path(str(self._choice.value)).name
            try:
                self._viewer.check()
            except OSError as error:
                raise InputError(str(error)) from None
            self._result.open(self._viewer.url_of(name), name)

    def _compare_two(self) -> None:
        names = [str(entry.value) for entry in (self._choice, self._other)]
        self._result.compare(*((self._recorded.entry(name), self._recorded.read(name)) for name in names))

    def _rename_chosen(self) -> None:
        new = self._recorded.rename(str(self._choice.value), self._name.value)
        self._choice.options = self._recorded.names()
        self._choice.value, self._by_hand = new, True
        self.refresh()

    def _ask(self, client: viser.ClientHandle | None) -> None:
        if client is None:
            return
        name = str(self._choice.value)
        modal = client.gui.add_modal("Delete this run?")
        with modal:
            add_html(client.gui, said(html("<b>{}</b> is removed from the disk.", name)))
            yes = client.gui.add_button("Delete it", icon=viser.Icon.TRASH, color="red")
            no = client.gui.add_button("Keep it", color="gray")

        @yes.on_click
        def _(_: Any) -> None:
            modal.close()
            self._post(lambda: self._delete_named(name), self._delete)

        no.on_click(lambda _: modal.close())

    def _delete_named(self, name: str) -> None:
        self._recorded.delete(name)
        self.refresh()

    def _post(self, job: Callable[[], None], control: Any = None) -> None:
        """On the files' thread; what is refused stands beside the control."""
        self._files.post(job.__qualname__, lambda: self._page.checked(job, control or self._choice))


def _card(entry: Entry) -> Html:
    """Settings and results of one recording."""
    size = _size(entry)
    if not entry.found:
        said = f"{entry.says}" if entry.says else "Signals without a result."
        return html("<div {}>{}<br><b>{}</b> {}</div>", _BOX, size, entry.kind.capitalize(), said)
    results = joined(
        html(
            "<div>{} {}{}</div>",
            named(name),
            explained(_result(answer, entry.found.values())),
            " ★" if name == entry.best and len(entry.found) > 1 else "",
        )
        for name, answer in entry.found.items()
    )
    settings = [
        html("{} <b>{}</b>", *setting(name, value))
        for name, value in entry.settings.items()
        if name == "seed" or value not in _UNSET
    ]
    return html(
        '<div {}>{}{}<div style="opacity:.8;font-size:12.5px">{}</div></div>',
        _BOX,
        size,
        results,
        joined(settings, " · "),
    )


def _size(entry: Entry) -> str:
    return f"{entry.at:%Y-%m-%d %H:%M:%S} · {entry.size_bytes / 1e6:.1f} MB"


def _result(answer: dict[str, Any], all_answers: Iterable[dict[str, Any]]) -> str:
    error = "" if answer.get("error_percent") is None else f"Err {answer['error_percent']:.2f} % · "
    alarms = ", ".join(answer.get("alarms", ())) or "no single k stands out"
    verdict = "healthy" if answer.get("healthy") else f"not healthy: {alarms}"
    stopped = " · stopped" if answer.get("stopped") else ""
    return f"{error}{error_said(answer, *all_answers)} · {answer['elapsed_s']:.1f} s · {verdict}{stopped}"


def _listed(entries: list[Entry]) -> Html:
    if not entries:
        return _empty("None yet.")
    rows = []
    for entry in entries:
        answer = entry.answer
        facts = [] if not answer else [error_said(answer, *entry.found.values())]
        if answer and answer.get("error_percent") is not None:
            facts.append(f"Err {answer['error_percent']:.2f} %")
        says = " · ".join(filter(None, (entry.kind, entry.says, *facts)))
        rows.append(
            html(
                '<div style="padding:2px 0;overflow-wrap:anywhere">{}<div style="opacity:.75;font-size:11.5px">{}</div>'
                "</div>",
                entry.name,
                explained(says),
            )
        )
    return html("<div {}>{}</div>", _BOX, joined(rows))


def _empty(text: str) -> Html:
    return html("<div {}>{}</div>", _BOX, text)


# --- the Runs tab: past runs, campaigns, and everything on the page as one file ---------------------------------------


class RunsTab(Tab):
    """Takes sessions from the browser."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self.result = RunsResult(self.page, right)
        self.page.screen.hear(shared.strip.themed, self.result.set_dark)

    def build(self) -> None:
        """The recordings, sessions and campaigns."""
        shared, page = self.shared, self.page
        recorded = RecordedRuns(shared.comparing.folder.recordings)
        self.panel = RunsPanel(page, shared.viewer, recorded, shared.files, self.result)
        self.sessions = SessionControls(page, shared.comparing, shared.files, shared.kept, shared.standings.lines)
        self.campaigns = CampaignControls(
            page,
            WORKSPACE,
            shared.campaigns,
            shared.files,
            self.right,
            self._show,
            lambda provenance: self.standing(provenance, saved=False),
        )
        for events in (shared.comparing.events, shared.discovering.events):
            events.kept.connect(lambda _: self.panel.refresh_soon())

    def place(self) -> Place:
        """The campaign."""
        return self.campaigns.place()

    def go_to(self, place: Place) -> None:
        """A recording, in the viewer, or a campaign."""
        for run in place.get("run", ())[:1]:
            self.panel.check(run)
            self.shared.files.post("address", partial(self.panel.choose, run))
        for name in place.get("campaign", ())[:1]:
            self.campaigns.choose(name)

    def follow(self, url: str, name: str) -> None:
        """Shows a run in the viewer while it is being written; from any thread."""
        self.shared.files.post("follow", lambda: self.panel.follow(url, name))

    def refresh_files(self) -> None:
        """Sessions that may be loaded, and plans that may be computed."""
        self.sessions.refresh(newest=False)
        self.campaigns.starts.refresh()

    def kept(self) -> dict[str, Part]:
        """The campaign that is shown."""
        return {"campaign": Part(self.campaigns.saved, lambda saved, _: self.campaigns.restore(saved))}

    def takes(self) -> dict[str, Callable[[Path], None]]:
        """Sessions."""
        return {SESSION_SUFFIX: self.sessions.uploaded}

    def _show(self, path: Path, run: Measurement) -> None:
        """A campaign's row was simulated again, and recorded there."""
        self.panel.choose(path.name)
        self.shared.strip.put(motion(run, HEALTHY, self.page.session.actuator), WORKSPACE.name)
