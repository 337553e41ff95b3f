"""The Identify tab and its panels."""

import viser

from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("identify", "Identify", viser.Icon.SEARCH, 2)
