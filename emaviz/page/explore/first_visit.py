"""A few words for the first visit, at the top of the Explore tab."""

from __future__ import annotations

import contextlib
from typing import Any

import viser

from emaviz.page.page import Page

_KEY = "emaviz started"
_TEXT = """
1. **Break it**: choose a preset, or drag a fault's slider. The 3D actuator and the charts show what changes.
2. **Watch it**: play, slow down or scrub below; the line in every chart is the same moment.
3. **Find it**: *Identify* recovers the faults from the current, each with an interval.
4. **Correct it**: *Compare* shows where the model fails on your own measurements, *Discover* which physics it lacks.
   New here? Begin with *Discover*'s guided challenge.
"""


class StartHere:
    """Shown until somebody says that it was read; a browser that has said so never sees it again."""

    def __init__(self, page: Page) -> None:
        gui = page.server.gui
        self._folder = gui.add_folder("Start here", visible=False)
        with self._folder:
            gui.add_markdown(_TEXT)
            read = gui.add_button("Got it", icon=viser.Icon.CHECK, color="gray")
        read.on_click(self._read)

        @page.server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            # A browser may have its storage blocked, or be gone again.
            with contextlib.suppress(RuntimeError, TimeoutError):
                if client.local_storage.get_item(_KEY, timeout=10.0) is None:
                    self._folder.visible = True

    def _read(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            kept = event.client.local_storage
            kept.set_item(_KEY, "1")
            # Gone only when the browser has kept it: a reload at once must not bring it back.
            with contextlib.suppress(RuntimeError, TimeoutError):
                kept.get_item(_KEY, timeout=2.0)
        self._folder.visible = False
