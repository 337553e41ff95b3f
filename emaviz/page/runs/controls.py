"""The Runs tab: past runs (.rrd) with what they were and what they found; reopen, rename, delete, compare."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from datetime import datetime
from typing import Any

import viser

from ema_model.errors import InputError
from emaviz.figures.convergence import named
from emaviz.page.page import Page
from emaviz.page.runs import WORKSPACE
from emaviz.page.runs.result import RunsResult
from emaviz.page.viewer_links import recording_link
from emaviz.recording.entry import Entry, error_said, setting
from emaviz.recording.viewer import ViewerHost
from emaviz.session.archive import Recorded
from emaviz.session.worker import Worker
from emaviz.text.html import Html, add_html, html, joined, said

NONE = "–"
_SHOWN = 25
_LOOK_S = 2.0  # between two looks at the folder
_UNSET = ("", "none", None, "0", "0.0", 0)  # settings that say that there is nothing of the kind, are not listed
_BOX = Html('style="padding:2px 10px;font-size:12.5px;line-height:1.45"')


class RunsPanel:
    """The tab's controls.  `result` is the panel on the right; files are read on the worker `files`."""

    def __init__(
        self, page: Page, viewer: ViewerHost | None, recorded: Recorded, files: Worker, result: RunsResult
    ) -> None:
        self._page, self._viewer, self._recorded = page, viewer, recorded
        self._files, self._result = files, result
        self._by_hand = False  # chosen; else the newest is shown
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
        self._choice.on_update(lambda event: event.client and self._post(self._take_choice))
        self._open.on_click(lambda _: self._post(self._open_chosen, self._open))
        self._compare.on_click(lambda _: self._post(self._compare_two, self._compare))
        self._rename.on_click(lambda _: self._post(self._rename_chosen, self._rename))
        self._delete.on_click(lambda event: event.client and self._ask(event.client))
        again.on_click(lambda _: self._post(self.refresh))
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

    def refresh(self) -> None:
        """Reads the folder again."""
        names = self._recorded.names()
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

    def _take_choice(self) -> None:
        self._by_hand = True
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
        exists = name != NONE
        self._open.disabled = not exists or self._viewer is None
        self._rename.disabled = self._delete.disabled = not exists
        self._offer_others()
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
        told = html('<div style="padding:8px 10px 2px;font-size:14px"><b>{}</b></div>{}', entry.name, _card(entry))
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

    def _ask(self, client: viser.ClientHandle) -> None:
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

        def checked() -> None:
            self._page.checked(job, control or self._choice)

        self._files.post(job.__qualname__, checked)


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
            _result(answer, entry.found.values()),
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
                says,
            )
        )
    return html("<div {}>{}</div>", _BOX, joined(rows))


def _empty(text: str) -> Html:
    return html("<div {}>{}</div>", _BOX, text)
