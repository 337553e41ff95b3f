"""The Recordings tab and its panels."""

import viser

from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("recordings", "Recordings", viser.Icon.LIST, 6, wider_px=140)  # for the Rerun viewer
