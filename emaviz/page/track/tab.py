"""The Track tab: k over the flights of a unit, what drifts, and what life remains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import viser

from emaviz.page.practice import Seal
from emaviz.page.tab import Shared, Tab
from emaviz.page.track import WORKSPACE
from emaviz.page.track.controls import TrackPanel
from emaviz.page.track.keep import TrackKeep
from emaviz.page.track.leads import FlightLead
from emaviz.page.track.result import TrackResult
from emaviz.session.saved import Part
from emaviz.session.track.following import Following


class TrackTab(Tab):
    """Leads to Compare, with a flight."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        following = self.following = Following(self.page.session, shared.comparing.folder, shared.files)
        self._standing = self.standing(self.following.provenance)
        with right.add_tab("Flights", viser.Icon.TIMELINE):
            self._standing.add(self.page.server.gui)
            self.result = TrackResult(
                self.page,
                shared.slow_screen,
                lambda chosen: FlightLead(self.page, shared.comparing, self.following, chosen),
                lambda: Seal(self.page, following.practice, lambda: following.chosen, lambda: following.last),
                lambda: TrackKeep(self.page, self.following, shared.viewer),
            )

    def build(self) -> None:
        """Which flights, and where the life ends."""
        self.panel = TrackPanel(self.page, self.following, self.result, self._standing)

    def refresh_files(self) -> None:
        """What may be followed."""
        self.panel.refresh()

    def kept(self) -> dict[str, Part]:
        """The flights, as they were identified."""
        return {"track": Part(self.following.saved, self._restore)}

    def _restore(self, saved: Any, _: Mapping[str, str]) -> None:
        self.following.restore(saved)
        self.panel.show()

    def close(self) -> None:
        """Ends the watch of the folder."""
        self.following.close()
