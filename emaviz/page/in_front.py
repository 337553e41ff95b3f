"""Which of the tabs on the right a window has in front, where what they show is drawn for those who see it alone."""

from __future__ import annotations

import json
from typing import Any

import viser

from emaviz.page.style import unseen
from emaviz.server.viser_private import Inside, id_of
from emaviz.session.signal import Signal
from emaviz.session.worker import Worker
from emaviz.text.html import add_html

# On the page: the button of the title in front among those given, or that of none of them, is pressed at each change.
_SCRIPT = """
(() => {
  const buttons = BUTTONS;
  window.emavizFront?.end();
  let told = null;
  const look = () => {
    const all = [...document.querySelectorAll('[role=tab]')];
    const tabs = all.filter(tab => tab.offsetParent && tab.textContent.trim() in buttons);
    if (!tabs.length) return;
    const front = tabs.find(t => t.getAttribute('aria-selected') === 'true')?.textContent.trim() ?? '';
    const button = document.getElementById(buttons[front]);
    if (!button || front === told) return;
    told = front;
    button.click();
  };
  const seen = new MutationObserver(look);
  seen.observe(document.body, { subtree: true, attributes: true, attributeFilter: ['aria-selected'] });
  const timer = setInterval(() => { if (told === null) look(); }, 250);
  window.emavizFront = { end: () => { seen.disconnect(); clearInterval(timer); } };
})();
"""


class InFront:
    """Titles of tabs whose content waits until a window has it in front.

    came: called with a title when that is so, on the screen's thread.
    """

    def __init__(self, server: viser.ViserServer, screen: Worker) -> None:
        self._server, self._screen = server, screen
        self._titles: list[str] = []
        self._at: dict[int, str] = {}  # by window, once it has told
        self.came: Signal[[str]] = Signal()
        server.on_client_disconnect(self._left)

    def add(self, *titles: str) -> None:
        """Before `connect`; no other tab of the page has such a title."""
        self._titles += titles

    def connect(self) -> None:
        """Begins to follow the windows; to be called where the unseen buttons may stand."""
        gui = self._server.gui
        buttons: dict[str, str] = {}
        for title in ("", *self._titles):
            button: Any = gui.add_button(f"front:{title}")
            button.on_click(lambda event, title=title: event.client and self._came(event.client.client_id, title))
            buttons[title] = id_of(button)
        add_html(gui, unseen(list(buttons.values())))
        Inside(self._server).run(_SCRIPT.replace("BUTTONS", json.dumps(buttons)))

    def anywhere(self, title: str) -> bool:
        """Whether it is in front of a window, or may be: one that has not told, or nobody knows what is read next."""
        windows = list(self._server.get_clients())
        return not windows or any(self._at.get(one, title) == title for one in windows)

    def _came(self, client: int, title: str) -> None:
        self._at[client] = title
        if title:
            self._screen.post(f"front:{title}", lambda: self.came(title))

    def _left(self, client: viser.ClientHandle) -> None:
        self._at.pop(client.client_id, None)
