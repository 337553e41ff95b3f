"""Keys: space plays, arrows step, digits change workspaces, Ctrl+Z takes a slider back; ? lists them as commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import viser

from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.page.workspaces import Workspace
from emaviz.server.viser_private import Inside

_MOST_DIGITS = 9
# viser's commands take no `?`, which here presses its own Ctrl+K; and an arrow that moves a focused slider or changes a
# tab is not to be a step as well.
_SCRIPT = """
(() => {
  window.emavizKeys?.();
  const typing = (at) => at.closest?.('input, textarea, select, [contenteditable=true]');
  const down = (event) => {
    if (event.key.startsWith('Arrow') && event.target.closest?.('[role=slider], [role=tab], [role=option]'))
      event.stopPropagation();
    if (event.key !== '?' || event.ctrlKey || event.metaKey || event.altKey || typing(event.target)) return;
    event.preventDefault();
    event.stopPropagation();
    const press = { key: 'k', code: 'KeyK', ctrlKey: true, bubbles: true, cancelable: true };
    document.body.dispatchEvent(new KeyboardEvent('keydown', press));
  };
  document.body.addEventListener('keydown', down);
  window.emavizKeys = () => document.body.removeEventListener('keydown', down);
})();
"""


def add_keys(page: Page, strip: PlaybackStrip, members: list[Workspace], undo: Callable[[], None]) -> None:
    """Registers them; in a field one types, and they do nothing.  undo(): on the screen's thread."""
    gui, post = page.server.gui, page.screen.post
    play = gui.add_command("Play or pause", hotkey="space", icon=viser.Icon.PLAYER_PLAY)
    play.on_trigger(lambda _: post("play", lambda: strip.play(not strip.playback.playing)))
    for title, key, steps, icon in (
        ("One step on", "arrowright", 1, viser.Icon.PLAYER_TRACK_NEXT),
        ("One step back", "arrowleft", -1, viser.Icon.PLAYER_TRACK_PREV),
    ):
        command = gui.add_command(title, hotkey=cast(Any, key), icon=icon)
        command.on_trigger(lambda _, steps=steps: post("step", lambda: strip.step(steps)))
    for digit, one in enumerate(members[:_MOST_DIGITS], 1):
        command = gui.add_command(f"Go to {one.title}", hotkey=cast(Any, str(digit)), icon=one.icon)
        command.on_trigger(lambda event, name=one.name: page.workspaces.go(name, event.client))
    back = gui.add_command("Undo on Explore", hotkey="Z", modifier="cmd/ctrl", icon=viser.Icon.ARROW_BACK_UP)
    back.on_trigger(lambda _: post("undo", undo))
    gui.add_command("List these keys: ?", icon=viser.Icon.KEYBOARD)
    Inside(page.server).run(_SCRIPT)
