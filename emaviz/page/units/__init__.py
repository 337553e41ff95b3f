"""The Units tab."""

import viser

from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("units", "Units", viser.Icon.LAYOUT_GRID, 5, share=0.66, lower=True)
