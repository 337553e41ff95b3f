"""The Library tab."""

import viser

from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("library", "Library", viser.Icon.BOOK, 7)
