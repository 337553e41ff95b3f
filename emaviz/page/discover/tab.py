"""The Discover tab: what the model lacks, step by step."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import viser

from ema_model.discovery.result import Experiment
from emaviz.page.discover import WORKSPACE
from emaviz.page.discover.controls import DiscoverPanel
from emaviz.page.discover.keep import DiscoveryKeep
from emaviz.page.discover.leads import leads
from emaviz.page.discover.result import DiscoveryPanel
from emaviz.page.explore.suggested_run import take_experiment
from emaviz.page.explore.tab import ExploreTab
from emaviz.page.tab import Shared, Tab
from emaviz.session.data_folder import CHALLENGE_SUFFIX
from emaviz.session.saved import Part


class DiscoverTab(Tab):
    """Takes sealed challenges from the browser; leads to Explore for the next experiment."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self._standing = self.standing(shared.discovering.provenance)
        with right.add_tab("Discovery", viser.Icon.BULB):
            self._standing.add(self.page.server.gui)
            self.result = DiscoveryPanel(
                self.page,
                shared.discovering,
                shared.strip,
                lambda: DiscoveryKeep(self.page, shared.discovering, shared.viewer),
                lambda: leads(
                    self.page, shared.discovering, lambda *model: shared.tab(ExploreTab).panel.take_plant(*model)
                ),
                self._load_experiment,
            )

    def build(self) -> None:
        """Which recordings, the run, and the steps."""
        shared = self.shared
        self.panel = DiscoverPanel(self.page, shared.discovering, self.result, shared.uploads, self._standing)

    def kept(self) -> dict[str, Part]:
        """Every discovery, with the files that they need."""
        discovering = self.shared.discovering
        return {"discovery": Part(discovering.saved, discovering.restore, discovering.files)}

    def takes(self) -> dict[str, Callable[[Path], None]]:
        """Sealed challenges."""
        return {CHALLENGE_SUFFIX: self.panel.source.uploaded}

    def _load_experiment(self, one: Experiment, client: viser.ClientHandle | None) -> None:
        explore = self.shared.tab(ExploreTab)
        take_experiment(explore.panel, one)
        self.page.workspaces.go(explore.workspace.name, client)
