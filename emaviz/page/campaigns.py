"""The Campaigns tab."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import viser

from ema_model.campaign.store import Store, summaries
from ema_model.errors import InputError
from ema_model.recordings import Measurement
from emaviz.page.panel import JobLine
from emaviz.page.tab import Standing
from emaviz.page.workspaces import Page
from emaviz.session.campaigns import Campaigns
from emaviz.session.inputs import Provenance
from emaviz.session.jobs import Worker
from emaviz.text.html import Html, add_html, html, joined, said

# --- campaigns, below the recordings: which one, its progress, and the row that opens as a run ------------------------

NONE = "–"
_MOST_ROWS = 500  # that can be chosen from: of a group, the errors and the worst first
_BOX = Html('style="padding:2px 10px;font-size:12.5px;line-height:1.45"')


class CampaignControls:
    """Controls on the left, the tables in a panel on the right; files are read on the worker `files`."""

    def __init__(
        self,
        page: Page,
        campaigns: Campaigns,
        files: Worker,
        panel: viser.PanelHandle,
        opened: Callable[[Path, Measurement], None],
        standings: Callable[[Provenance], Standing],
    ) -> None:
        """opened(path, run): a row was simulated again, and is recorded there; standings: says how the tables stand."""
        self._page, self._campaigns, self._files = page, campaigns, files
        self._rows: dict[str, str] = {}  # names of the rows, by what the list says of them
        gui = page.server.gui
        with gui.add_folder("Campaigns", expand_by_default=False):
            self._choice: Any = gui.add_dropdown("Campaign", (NONE,))
            self._group: Any = gui.add_dropdown("Group", (NONE,))
            self._row: Any = gui.add_dropdown("Row", (NONE,))
            self._open = gui.add_button("Open as a run", icon=viser.Icon.PLAYER_PLAY, disabled=True)
            self._status = add_html(gui, _box("None below the data folder; emaviz gui --campaign DIR opens one."))
            JobLine(page, campaigns.job)
            again = gui.add_button("Look for campaigns again", icon=viser.Icon.REFRESH, color="gray")
        self._provenance = Provenance("the table", again.label, lambda: campaigns.inputs(str(self._choice.value)))
        standing = standings(self._provenance)
        standing.connect(again)
        with panel.add_tab("Campaign", viser.Icon.TABLE):
            standing.add(gui)
            self._tables = add_html(gui, _box("Choose a campaign on the left."))
        self._choice.on_update(lambda event: event.client and self._post(self._show))
        self._group.on_update(lambda event: event.client and self._post(self._show_rows))
        self._open.on_click(lambda _: self._post(self._open_chosen))
        again.on_click(lambda _: self._post(self.refresh))
        campaigns.opened.connect(lambda path, run: self._post(lambda: opened(path, run)))
        self._post(self.refresh)

    # --- on the files' thread ---------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Looks for campaigns again."""
        names = self._campaigns.names() or [NONE]
        self._choice.options = names
        if self._choice.value not in names:
            self._choice.value = names[0]
        self._show()

    def _show(self) -> None:
        name = str(self._choice.value)
        if name == NONE:
            return
        store = self._campaigns.store(name)
        self._group.options = list(store.header.kinds) or [NONE]
        self._provenance.take()
        self._tables.content = tables(store)
        self._say(_progress(store))
        self._show_rows()

    def _show_rows(self) -> None:
        if self._choice.value == NONE:
            return
        store, group = self._campaigns.store(str(self._choice.value)), str(self._group.value)
        kind = store.header.kinds.get(group)
        rows = [] if kind is None else [row for row in store.table(kind).to_pylist() if row["group"] == group]
        rows.sort(key=_worst)
        self._rows = {label(row, number): row["name"] for number, row in enumerate(rows[:_MOST_ROWS], 1)}
        self._row.options = list(self._rows) or [NONE]
        self._open.disabled = not self._rows

    def _open_chosen(self) -> None:
        chosen = str(self._row.value)
        if chosen not in self._rows:
            raise InputError("there is no such row; choose another")
        self._page.begins(lambda: self._campaigns.open_row(str(self._choice.value), self._rows[chosen]), self._open)

    def _say(self, text: str) -> None:
        self._status.content = said(text)

    def _post(self, job: Callable[[], None]) -> None:
        """On the files' thread; what is refused stands below the list."""

        def checked() -> None:
            self._page.checked(job, self._choice)

        self._files.post(f"campaign {job.__qualname__}", checked)


def label(row: Mapping[str, Any], number: int) -> str:
    """What the list says of a row; the number tells those apart that say the same."""
    if row["error"] is not None:
        told = "error"
    elif "verdict" in row:
        told = " + ".join(row["effects"] or ()) or row["verdict"] or "not showable"
    elif "error_wrapped_percent" in row:
        error = row["error_wrapped_percent"]
        told = f"rmse {row['rmse_A']:.3f} A" if error is None else f"Err {error:.2f} %"
    else:
        told = "adequate" if row["adequate"] else str(row["variable"] or "not adequate")
    return " · ".join(filter(None, (f"{number}", told, row["case"], f"seed {row['seed']}")))


def tables(store: Store) -> Html:
    """What the rows say together."""
    parts = [html("<h3>{}</h3><p>{}</p>", store.header.title, store.header.about)]
    for one in summaries(store):
        head = joined(html("<th>{}</th>", title) for title in one.heads)
        lines = joined(html("<tr>{}</tr>", joined(html("<td>{}</td>", cell) for cell in line)) for line in one.lines)
        parts.append(html("<h4>{}</h4><table><tr>{}</tr>{}</table>", one.title, head, lines))
    style = Html(
        "<style>.emaviz-campaign td,.emaviz-campaign th{padding:1px 8px 1px 0;text-align:left;vertical-align:top}"
        "</style>"
    )
    return style + html(
        '<div class="emaviz-campaign" style="padding:4px 10px;overflow:auto;font-size:12.5px">{}</div>', joined(parts)
    )


def _progress(store: Store) -> str:
    groups = store.progress().values()
    rows, tasks, errors = (sum(one[name] for one in groups) for name in ("rows", "tasks", "errors"))
    return f"{rows} of {tasks} tasks have a row" + (f", {errors} of them an error" if errors else "")


def _worst(row: Mapping[str, Any]) -> tuple[bool, float, int]:
    """Errors first, then the largest Err %."""
    return row["error"] is None, -(row.get("error_wrapped_percent") or 0.0), row["seed"]


def _box(text: str) -> Html:
    return html("<div {}>{}</div>", _BOX, text)
