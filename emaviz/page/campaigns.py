"""The Campaigns tab."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import plotly.graph_objects as go
import viser

from ema_model.campaign.store import Campaign, Store, summaries
from ema_model.discovery.result import effect_title
from ema_model.errors import InputError
from ema_model.quantities import NOTHING, explanation_title
from ema_model.recordings import Measurement
from emaviz.figures.campaign import counted
from emaviz.page.panel import JobLine
from emaviz.page.share import Place
from emaviz.page.tab import Standing
from emaviz.page.workspaces import Page, Workspace
from emaviz.server.safe_server import RESULTS
from emaviz.session.campaigns import REPORT, Campaigns, Computing
from emaviz.session.jobs import Worker
from emaviz.session.session_file import Provenance
from emaviz.text.html import Html, add_html, begin, html, joined, said
from emaviz.views.campaign import answers, case_in_words, counted_px, errors_drawn, in_words

# --- campaigns, below the recordings: which one, its progress, and the row that opens as a run ------------------------

NONE = "–"
_TAB = "Campaign"
_STEPS = (
    Html("Choose a plan on the left, under <b>Compute a campaign</b>: the thesis's evaluation, or another one."),
    Html("Press <b>Compute</b>: its tasks run in processes of their own, and you can work on."),
    "Rows, errors and answers are drawn here as they come; a Stop keeps them, and it goes on from there.",
)
_THESIS = {"thesis_quick": "thesis: reproduce it, quick", "thesis": "thesis: reproduce it, whole"}
_MOST_FIGURES, _ASPECT, _ERRORS_PX = 2, 0.32, 320
_MOST_ROWS = 500  # that can be chosen from: of a group, the errors and the worst first
_BOX = Html('style="padding:2px 10px;font-size:12.5px;line-height:1.45"')


class CampaignControls:
    """Controls on the left, the tables in a panel on the right; files are read on the worker `files`."""

    def __init__(
        self,
        page: Page,
        at: Workspace,
        campaigns: Campaigns,
        files: Worker,
        panel: viser.PanelHandle,
        opened: Callable[[Path, Measurement], None],
        standings: Callable[[Provenance], Standing],
    ) -> None:
        """opened(path, run): a row was simulated again, and is recorded there; standings: says how the tables stand."""
        self._page, self._at, self._campaigns, self._files = page, at, campaigns, files
        self._new = self._unseen = False  # one has begun, and is not yet chosen; and nobody has seen it
        self._rows: dict[str, str] = {}  # names of the rows, by what the list says of them
        gui = page.server.gui
        with gui.add_folder("Campaigns", expand_by_default=False):
            self._choice: Any = gui.add_dropdown("Campaign", (NONE,))
            self._group: Any = gui.add_dropdown("Group", (NONE,))
            self._row: Any = gui.add_dropdown("Row", (NONE,))
            self._open = gui.add_button("Open as a run", icon=viser.Icon.PLAYER_PLAY, disabled=True)
            self._status = add_html(gui, _box("None below the data folder; emaviz gui --campaign DIR opens one."))
            JobLine(page, campaigns.job, at)
            again = gui.add_button("Look for campaigns again", icon=viser.Icon.REFRESH, color="gray")
        with gui.add_folder("Compute a campaign", expand_by_default=False):
            self.starts = _Starts(page, at, campaigns, files)
        self._provenance = Provenance("the table", again.label, lambda: campaigns.inputs(str(self._choice.value)))
        standing = standings(self._provenance)
        standing.connect(again)
        with panel.add_tab(_TAB, viser.Icon.TABLE):
            standing.add(gui)
            self._links = add_html(gui)
            self._progress = add_html(gui, begin("No campaign is here yet", _STEPS))
            self._figures = [
                gui.add_plotly(go.Figure(), config={"displayModeBar": False}, aspect=_ASPECT, visible=False)
                for _ in range(_MOST_FIGURES)
            ]
            self._tables = add_html(gui)
        page.changed(self._choice, self._show, on=files)
        page.changed(self._group, partial(self._try, self._show_rows), on=files)
        page.pressed(self._open, partial(self._try, self._open_chosen), on=files)
        page.pressed(again, partial(self._try, self.refresh), on=files)
        page.workspaces.entered.connect(self._show_it)
        campaigns.computing.began.connect(lambda _: self._begun())
        files.hear(campaigns.grown, partial(self._try, self._grow))
        files.hear(campaigns.written, lambda name, _: self._try(self._grow, name))
        files.hear(campaigns.opened, partial(self._try, opened))
        files.post("campaigns", partial(self._try, self.refresh))

    def place(self) -> Place:
        """The campaign that is shown."""
        name = str(self._choice.value)
        return {} if name == NONE else {"campaign": [name]}

    def choose(self, name: str) -> None:
        """Another campaign by its name; InputError where there is none."""
        self._campaigns.store(name)
        self._choice.options, self._choice.value = self._campaigns.names(), name
        self._page.workspaces.bring_forward(self._at.name, "", _TAB)
        self._files.post("campaign", partial(self._try, self._show))

    def saved(self) -> dict[str, Any] | None:
        """The campaign that is shown, for a session's file."""
        return self._campaigns.saved(str(self._choice.value))

    def restore(self, saved: Any) -> None:
        """Takes a session's, and shows it; what is wrong with it stands below the list."""
        if saved is not None:
            try:
                self.choose(self._campaigns.restore(saved))
            except InputError as error:
                self._say(str(error))

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
        self._progress.content = progress_bars(store)
        self._links.content = self._reports(name)
        self._draw(store)
        self._tables.content = tables(store)
        self._say(_progress(store))
        self._show_rows()

    def _reports(self, name: str) -> Html:
        """A link to what was written of it."""
        if not self._campaigns.has_report(name):
            return Html()
        at = f"{RESULTS}{quote(name)}/{REPORT}"
        return html('<div class="emaviz-report"><a href="{}" target="_blank" rel="noopener">Report ↗</a></div>', at)

    def _draw(self, store: Store) -> None:
        """What the rows say so far, as figures."""
        drawn = figures(store)
        for place, plot in enumerate(self._figures):
            if place < len(drawn):
                plot.figure, height_px = drawn[place]
                self._page.workspaces.heights.set_height(plot, height_px)
            plot.visible = place < len(drawn)

    def _begun(self) -> None:
        """One is computed: it is chosen with its first rows."""
        self._new = self._unseen = True
        self._show_it(self._at.name)

    def _show_it(self, workspace: str) -> None:
        """Its tab comes to the front, once, in a window that is here or comes here."""
        if self._unseen and workspace == self._at.name and self._page.workspaces.anyone(workspace):
            self._unseen = False
            self._page.workspaces.bring_forward(workspace, "", _TAB)

    def _grow(self, name: str) -> None:
        """Rows more of a campaign; one that has just begun is the one that is shown."""
        if self._new and name in self._campaigns.names():
            self._choice.options = self._campaigns.names()
            self._choice.value, self._new = name, False
        if self._choice.value == name:
            self._show()

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

    def _try(self, act: Callable[..., object], *values: Any) -> None:
        """What is refused stands below the list."""
        self._page.checked(lambda: act(*values), self._choice)


class _Starts:
    """What is to be computed, and with how many processes."""

    def __init__(self, page: Page, at: Workspace, campaigns: Campaigns, files: Worker) -> None:
        self._page, self._campaigns, self._files = page, campaigns, files
        gui, names = page.server.gui, campaigns.plans()
        self._titles = {_THESIS.get(name, name): name for name in names}
        hint = "The thesis's evaluation, a plan that is shipped, or a .toml in the data folder's plans"
        self._plan: Any = gui.add_dropdown("Plan", tuple(self._titles), hint=hint)
        self._name: Any = gui.add_text(
            "Folder", names[0], hint="In the data folder's campaigns; one that is there goes on"
        )
        most = campaigns.cores()
        self._workers: Any = gui.add_number("Processes", most, min=1, max=max(most + 1, 64), step=1)
        self._about = add_html(gui)
        self._start = gui.add_button("Compute", icon=viser.Icon.PLAYER_PLAY)
        JobLine(page, campaigns.computing, at)
        page.changed(self._plan, self._take_plan)
        for control in (self._name, self._workers):
            page.changed(control, self._tell_soon)
        page.pressed(self._start, self._begin)
        self._tell_soon()

    @property
    def _asked(self) -> Computing:
        return Computing(self._titles.get(str(self._plan.value), ""), str(self._name.value), int(self._workers.value))

    def refresh(self) -> None:
        """Plans that came into the data folder since."""
        self._titles = {_THESIS.get(name, name): name for name in self._campaigns.plans()}
        if tuple(self._plan.options) != tuple(self._titles):
            self._plan.options = tuple(self._titles)

    def _take_plan(self) -> None:
        self._name.value = Path(self._asked.plan).stem
        self._tell_soon()

    def _tell_soon(self) -> None:
        self._files.post("plan", lambda: self._page.checked(self._tell, self._name))

    def _tell(self) -> None:
        self._about.content = _box(self._campaigns.about(self._asked))

    def _begin(self) -> None:
        asked = self._asked
        self._page.begins(lambda: self._campaigns.begin(asked), self._start, f"Campaign {asked.name}", asked.name)
        self._tell_soon()


def figures(store: Store) -> list[tuple[go.Figure, int]]:
    """How the errors of identifications are spread, and how often what was answered; with their heights, px."""
    found = Campaign(store)
    known = found.of_known_truth()
    drawn = [(errors_drawn(known), _ERRORS_PX)] if known else []
    told = [(counted(title, counts), counted_px(counts)) for title, counts in answers(found).items()]
    return [*drawn, *told][:_MOST_FIGURES]


def progress_bars(store: Store) -> Html:
    """How many tasks of each group have a row."""
    lines = [
        html(
            '<tr><td>{}</td><td style="width:220px;vertical-align:middle">'
            '<div class="emaviz-job-share" style="width:200px"><i style="width:{:.1f}%"></i></div></td>'
            "<td>{} of {}{}</td></tr>",
            in_words(group),
            100.0 * one["rows"] / max(one["tasks"], 1),
            one["rows"],
            one["tasks"],
            f", {one['errors']} of them an error" if one["errors"] else "",
        )
        for group, one in store.progress().items()
    ]
    head = html("<h3>{}</h3><p>{}</p>", store.header.title, store.header.about)
    return _styled(html("{}<table>{}</table>", head, joined(lines)))


def label(row: Mapping[str, Any], number: int) -> str:
    """What the list says of a row; the number tells those apart that say the same."""
    if row["error"] is not None:
        told = "error"
    elif "verdict" in row:
        told = " + ".join(map(effect_title, row["effects"] or ())) or in_words(row["verdict"] or "not showable")
    elif "error_wrapped_percent" in row:
        error = row["error_wrapped_percent"]
        told = f"rmse {row['rmse_A']:.3f} A" if error is None else f"Err {error:.2f} %"
    elif "adequate" not in row:  # what it found is in the tables
        told = ""
    else:
        told = "adequate" if row["adequate"] else explanation_title(row["variable"], row["modulator"])
        told = "not adequate" if told == NOTHING else told
    return " · ".join(filter(None, (f"{number}", told, case_in_words("", row["case"]), f"seed {row['seed']}")))


def tables(store: Store) -> Html:
    """What the rows say together."""
    parts = []
    for one in summaries(store):
        head = joined(html("<th>{}</th>", title) for title in one.heads)
        lines = joined(html("<tr>{}</tr>", joined(html("<td>{}</td>", cell) for cell in line)) for line in one.lines)
        parts.append(html("<h4>{}</h4><table><tr>{}</tr>{}</table>", one.title, head, lines))
    return _styled(joined(parts))


def _styled(content: Html) -> Html:
    style = Html(
        "<style>.emaviz-campaign td,.emaviz-campaign th{padding:1px 8px 1px 0;text-align:left;vertical-align:top}"
        "</style>"
    )
    return style + html(
        '<div class="emaviz-campaign" style="padding:4px 10px;overflow:auto;font-size:12.5px">{}</div>', content
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
