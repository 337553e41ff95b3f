"""The Discover tab and its panels."""

import viser

from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("discover", "Discover", viser.Icon.BULB, 4, lower=True)
