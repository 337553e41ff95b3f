"""What panels share: the server, the session, the screen's thread, the workspaces, and messages to the user."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import viser

from ema_model.errors import InputError
from emaviz.page.workspaces import Workspaces
from emaviz.server.beside import say_beside
from emaviz.server.viser_private import Inside, id_of
from emaviz.session.session import Session
from emaviz.session.worker import Worker
from emaviz.text.results import begun, within


@dataclass(frozen=True)
class Page:
    """Handed to every panel."""

    server: viser.ViserServer
    session: Session
    screen: Worker  # draws, at a pace that browsers can follow
    workspaces: Workspaces  # which windows are where
    folder: Path | None = None  # of the data, whose files messages name without it
    _refused: set[str] = field(default_factory=set)  # controls beside which something is said

    def notify(self, title: str, text: str, colour: Any = "red") -> None:
        """A message in every open browser."""
        for client in self.server.get_clients().values():
            client.add_notification(title, begun(self.local(text)), auto_close_seconds=8.0, color=colour)

    def local(self, text: str) -> str:
        """A message that names files relative to the data folder, not by where the server has it."""
        return text if self.folder is None else within(text, self.folder)

    def checked(self, change: Callable[[], Any], control: Any = None) -> bool:
        """Applies a change of settings; a bad value becomes a message and leaves the old one.

        control: beside which that stands until it is changed; a message that goes away is for what has no place.
        """
        try:
            change()
        except InputError as error:
            if control is None:
                self.notify("Input refused", str(error))
            else:
                self.say_beside(control, str(error))
            return False
        if control is not None:
            self.say_beside(control, "")
        return True

    def ask(self, kind: str, asked: Callable[[], Any], control: Any = None) -> None:
        """Does what was asked soon, on the screen's thread; what is refused stands beside the control that asked."""

        def checked() -> None:
            self.checked(asked, control)

        self.screen.post(kind, checked)

    def say_beside(self, control: Any, text: str) -> None:
        """Stands below a control until it is used again; no text takes it away."""
        if text or id_of(control) in self._refused:
            (self._refused.add if text else self._refused.discard)(id_of(control))
            say_beside(Inside(self.server), control, self.local(text))

    def begins(self, begin: Callable[[], bool], button: Any = None) -> bool:
        """Begins a long run, or says why not, below the button that asks for it.

        begin(): whether nothing else runs; InputError: what is missing.
        """
        started = False

        def tried() -> None:
            nonlocal started
            if not self.session.ready.is_set():
                self._wait("One moment", "The models are still being compiled.", button)
            elif not (started := begin()):
                self.one_at_a_time(button)

        return self.checked(tried, button) and started

    def one_at_a_time(self, button: Any = None) -> None:
        """Says that another long run goes on; with a button by raising InputError, which `checked` says beside it."""
        running = self.session.worker.doing or "Another long run"
        self._wait("One at a time", f"{running} goes on; stop it first.", button)

    def _wait(self, title: str, text: str, button: Any) -> None:
        if button is not None:
            raise InputError(text)
        self.notify(title, text, "yellow")
