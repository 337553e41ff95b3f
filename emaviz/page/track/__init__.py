"""The Track tab."""

import viser

from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("track", "Track", viser.Icon.TIMELINE, 6, share=0.66, lower=True)
