"""Keys: space plays, digits change workspaces.  Ctrl+K lists them all, since every one is a command."""

from __future__ import annotations

from typing import Any, cast

import viser

from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.page.workspaces import Workspace

_MOST_DIGITS = 9


def add_keys(page: Page, strip: PlaybackStrip, members: list[Workspace]) -> None:
    """Registers them; in a field one types, and they do nothing."""
    gui = page.server.gui
    play = gui.add_command("Play or pause", hotkey="space", icon=viser.Icon.PLAYER_PLAY)
    play.on_trigger(lambda _: page.screen.post("play", lambda: strip.play(not strip.playback.playing)))
    for digit, one in enumerate(members[:_MOST_DIGITS], 1):
        command = gui.add_command(f"Go to {one.title}", hotkey=cast(Any, str(digit)), icon=one.icon)
        command.on_trigger(lambda event, name=one.name: page.workspaces.go(name, event.client))
