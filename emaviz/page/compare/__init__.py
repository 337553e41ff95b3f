"""The Compare tab and its panels."""

import viser

from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("compare", "Compare", viser.Icon.ARROWS_DIFF, 3)
