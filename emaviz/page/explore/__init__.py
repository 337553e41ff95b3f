"""The Explore tab and its panels."""

import viser

from emaviz.page.workspaces import Workspace

PHASES, METRICS = "Phases", "Metrics"
WORKSPACE = Workspace(
    "explore", "Explore", viser.Icon.ADJUSTMENTS, 1, share=0.4, inset=False, waiting=(PHASES, METRICS)
)
