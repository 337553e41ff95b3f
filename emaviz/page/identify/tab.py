"""The Identify tab: the search for the faults, watched, and its answer."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import msgspec
import viser

from emaviz.figures.identified_table import Row
from emaviz.page.explore.suggested_run import take_separating
from emaviz.page.explore.tab import ExploreTab
from emaviz.page.identify import WORKSPACE
from emaviz.page.identify.controls import IdentifyPanel
from emaviz.page.identify.result import IdentifyResult
from emaviz.page.identify.to_discover import take_to_discover
from emaviz.page.runs.tab import RunsTab
from emaviz.page.tab import Shared, Tab
from emaviz.session.described import taken
from emaviz.session.saved import Part


class IdentifyTab(Tab):
    """Leads to Explore for the next run, to Recordings for the viewer, to Discover where the model does not fit."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self._standing = self.standing(self.page.session.identifying.provenance)
        self.result = IdentifyResult(
            self.page,
            shared.slow_screen,
            right,
            shared.strip,
            self._standing,
            lambda run: take_separating(shared.tab(ExploreTab).panel, run),
        )

    def build(self) -> None:
        """What is identified, and how."""
        shared = self.shared
        self.panel = IdentifyPanel(
            self.page,
            shared.comparing,
            shared.viewer,
            self.result,
            self._standing,
            open_viewer=lambda url, name: shared.tab(RunsTab).result.open(url, name),
            to_discover=partial(take_to_discover, self.page, shared.discovering),
        )

    def show_settings(self) -> None:
        """Of the search."""
        self.panel.show_settings()

    def refresh_files(self) -> None:
        """What may be identified."""
        self.panel.refresh_sources()

    def kept(self) -> dict[str, Part]:
        """The table of runs."""
        return {"runs": Part(lambda: msgspec.to_builtins(self.result.rows), self._restore)}

    def _restore(self, saved: Any, _: Mapping[str, str]) -> None:
        self.result.show_rows(taken(list[Row], saved, "table of runs"))
