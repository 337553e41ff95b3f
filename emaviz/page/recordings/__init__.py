"""The Recordings tab and its panels."""

import viser

from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("recordings", "Recordings", viser.Icon.LIST, 8, share=0.66)  # for the Rerun viewer
