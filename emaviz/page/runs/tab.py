"""The Runs tab: past runs, campaigns, and everything on the page as one file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import viser

from ema_model.faults import HEALTHY
from ema_model.recordings import Measurement
from emaviz.page.campaigns.controls import CampaignControls
from emaviz.page.runs import WORKSPACE
from emaviz.page.runs.controls import RunsPanel
from emaviz.page.runs.result import RunsResult
from emaviz.page.runs.sessions import SessionControls
from emaviz.page.tab import Shared, Tab
from emaviz.scene.motion import motion
from emaviz.session.archive import Recorded
from emaviz.session.data_folder import SESSION_SUFFIX


class RunsTab(Tab):
    """Takes sessions from the browser."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self.result = RunsResult(self.page, right)
        shared.strip.themed.connect(lambda dark: self.page.screen.post("viewer", lambda: self.result.set_dark(dark)))

    def build(self) -> None:
        """The recordings, sessions and campaigns."""
        shared, page = self.shared, self.page
        recorded = Recorded(shared.comparing.folder.recordings)
        self.panel = RunsPanel(page, shared.viewer, recorded, shared.files, self.result)
        self.sessions = SessionControls(page, shared.comparing, shared.files, shared.kept, shared.standings.lines)
        CampaignControls(
            page,
            shared.campaigns,
            shared.files,
            self.right,
            self._show,
            lambda provenance: self.standing(provenance, saved=False),
        )
        for events in (shared.comparing.events, shared.discovering.events):
            events.kept.connect(lambda _: self.panel.refresh_soon())

    def takes(self) -> dict[str, Callable[[Path], None]]:
        """Sessions."""
        return {SESSION_SUFFIX: self.sessions.uploaded}

    def _show(self, path: Path, run: Measurement) -> None:
        """A campaign's row was simulated again, and recorded there."""
        self.panel.choose(path.name)
        self.shared.strip.put(motion(run, HEALTHY, self.page.session.actuator), WORKSPACE.name)
