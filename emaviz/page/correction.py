"""Model correction, one flow over Compare and Discover: its four steps at the top of both, and where it stands.

Columns → fit and regions → what is missing → the ladder and the improved model.  Each step leads to where it is done;
the next one is marked.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ema_model.quantities import number
from emaviz.page.workspaces import Page
from emaviz.server.viser_private import id_of
from emaviz.session.discover.discovering import Discovering
from emaviz.text.html import Html, HtmlPiece, add_html, html, joined, unescaped

COLUMNS, FIT, MISSING, IMPROVED = range(4)
TITLES = ("Columns", "Fit and regions", "What is missing", "Ladder and model")
_STYLE = unescaped(
    "<style>.emaviz-flow{display:flex;gap:4px;padding:4px 10px 6px;font-size:12.5px;line-height:1.25}"
    ".emaviz-flow a{flex:1 1 0;min-width:0;font:inherit;color:inherit;text-align:left;cursor:pointer;"
    "padding:4px 8px;border:0;border-top:3px solid rgba(134,142,150,.35);background:rgba(134,142,150,.08)}"
    ".emaviz-flow a[aria-disabled]{cursor:default;opacity:.55}.emaviz-flow .done{border-top-color:#0c8599}"
    ".emaviz-flow .next{border-top-color:#f08c00;background:rgba(240,140,0,.14)}"
    ".emaviz-flow .here{outline:1.5px solid currentColor;outline-offset:-1.5px}"
    ".emaviz-flow span{display:block;opacity:.75;overflow-wrap:anywhere}</style>"
)


@dataclass(frozen=True)
class Stage:
    """A step as it stands."""

    text: str  # what is known of it: '4 measurements', '3.69 × floor'
    done: bool = False
    can: bool = True  # whether it can be gone to


def stages(discovering: Discovering, of_compare: bool) -> tuple[Stage, ...]:
    """The four of them, as the session stands; of_compare: of its recordings, whatever is discovered meanwhile."""
    comparing, challenge = discovering.comparing, discovering.source.challenge
    aside = of_compare and challenge is not None  # Discover has a challenge
    challenge, look = None if aside else challenge, None if aside else discovering.look
    opened = list(comparing.opened.values())
    unclear = [one for one in opened if one.measurement is None]
    held = sum(one.name in comparing.held_out for one in opened)
    files = f"{len(opened)} measurement{'' if len(opened) == 1 else 's'}{f', {held} held out' if held else ''}"
    compared = comparing.comparison
    columns = Stage("to be checked" if unclear else files if opened else "no file yet", bool(opened) and not unclear)
    fit = Stage("–", can=bool(opened))
    if challenge is not None:
        columns = Stage("of a challenge", True, bool(opened))
        fit = Stage("calibrated" if look is not None else "–", look is not None, bool(opened))
    elif compared is not None:
        fit = Stage(f"error {number(compared.over_floor)} × floor", comparing.finished is not None)
    elif comparing.running:
        fit = Stage("calibrating …")
    can = look is not None or compared is not None
    missing, improved = Stage("click to look" if can else "–", can=can), Stage("–", can=look is not None)
    if look is not None:
        known, count = look.assessment is not None, len(look.promising)
        told = f"{count} candidate{'' if count == 1 else 's'}" if count else "nothing more"
        missing = Stage(told if known else "scoring …", known and not count)
        if look.removable:
            unseen = look.found.ladder[-1].holdout_rmse
            also = "" if unseen is None else f", held out {number(unseen)}"
            improved = Stage(f"{number(look.rmse)}{also} × floor", look.found.at_floor)
    elif discovering.running and not aside:
        missing = Stage("looking …")
    return columns, fit, missing, improved


class Correction:
    """The line of steps.  Everything here is done on the screen's thread."""

    def __init__(self, page: Page, discovering: Discovering) -> None:
        self._page, self._discovering = page, discovering
        self._lines: list[tuple[str, HtmlPiece]] = []  # each with the workspace that it stands in
        self._ways: dict[int, str] = {}  # what a click on a step runs, where that is not the way to its workspace
        comparing = discovering.comparing
        for happens in (
            *(comparing.events.opened, comparing.events.removed, comparing.events.held, comparing.events.compared),
            *(comparing.job.began, comparing.job.ended, discovering.events.looked),
            *(discovering.job.began, discovering.job.ended),
        ):
            happens.connect(lambda *_: page.screen.post("correction", self.refresh))

    def add(self, workspace: str) -> None:
        """Here, at the top of a tab."""
        add_html(self._page.server.gui, _STYLE)
        self._lines.append((workspace, add_html(self._page.server.gui)))
        self.refresh()

    def leads(self, step: int, button: Any) -> None:
        """A click on a step presses this button."""
        self._ways[step] = f"document.getElementById('{id_of(button)}')?.click()"

    def refresh(self) -> None:
        """As the session stands now."""
        for workspace, piece in self._lines:
            found = stages(self._discovering, workspace == "compare")
            following = next((i for i, one in enumerate(found) if not one.done), None)
            content = _line(found, following, self._at(workspace), lambda step, at=workspace: self._way(step, at))
            if piece.content != content:
                piece.content = content

    def _at(self, workspace: str) -> tuple[int, ...]:
        """The steps that a workspace shows now."""
        look = self._discovering.look
        if workspace == "compare":
            return (FIT,) if self._discovering.comparing.comparison is not None else (COLUMNS,)
        return (MISSING, IMPROVED) if look is not None and look.removable else (MISSING,)

    def _way(self, step: int, workspace: str) -> str:
        """What a click on a step runs: it goes to its workspace, and presses there what shows it, or begins it."""
        to = "compare" if step in (COLUMNS, FIT) else "discover"
        go = f"window.emavizViews?.go({json.dumps(to)})"
        begun = self._discovering.is_of_compare or (workspace == to and self._discovering.look is not None)
        if step not in self._ways or (step == MISSING and begun):
            return go
        return self._ways[step] if step == MISSING else f"{go};{self._ways[step]}"  # whose button goes there itself


def _line(found: tuple[Stage, ...], following: int | None, here: tuple[int, ...], way: Callable[[int], str]) -> Html:
    steps = joined(
        html(
            '<a role="link" tabindex="0" class="{}"{}><b>{} {}</b><span>{}{}</span></a>',
            " ".join(
                word for word, so in (("done", one.done), ("next", place == following), ("here", place in here)) if so
            ),
            html(' onclick="{}"', way(place)) if one.can else Html(' aria-disabled="true"'),
            place + 1,
            TITLES[place],
            "✓ " if one.done else "",
            one.text,
        )
        for place, one in enumerate(found)
    )
    return html('<nav class="emaviz-flow emaviz-all-columns" aria-label="Model correction">{}</nav>', steps)
