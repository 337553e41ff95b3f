"""The Runs tab and its panels."""

import viser

from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("runs", "Runs", viser.Icon.LIST, 8, share=0.66)  # for the Rerun viewer
