"""Files from the browser, written to the disk as they come, within a limit.

viser keeps an upload in memory, whatever its size, until it is complete.  Here its two messages are answered
instead: a transfer that is too large is refused before its first byte is kept, and one that does not keep to
what it announced is dropped.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import viser

from ema_model.errors import InputError
from ema_model.files.opened import FILE_BYTES, PAGE_BYTES, megabytes, shown
from ema_model.recordings.formats import FORMATS
from emaviz.server.viser_private import Inside, TransferPart, TransferStart, id_of
from emaviz.session.data_folder import DataFolder, sanitised
from emaviz.text.html import Html, add_html

_MOST_TRANSFERS = 20  # at once
_SETTLE_S = 0.5  # after which the browser has drawn its own message, so that it can be taken away

_UNSEEN = Html(
    '<div class="emaviz-drop"></div><style>div:has(> .emaviz-drop),div:has(> .emaviz-drop)+div{display:none}</style>'
)
# A file dropped anywhere on the page goes the way of that button, one after another.
_DROP = """
(() => {
  if (window.__emavizDrop) return;
  window.__emavizDrop = true;
  // a file that was refused can be chosen again: an input that keeps its value would say nothing of it
  window.addEventListener('click', (event) => {
    const chosen = event.target.matches?.('input[type=file]') ? event.target : null;
    if (chosen) chosen.value = '';
  }, true);
  const input = () => {
    const button = Array.from(document.querySelectorAll('button')).find(b => b.textContent === 'Drop');
    return button?.parentElement?.querySelector('input[type=file]') ?? document.querySelector('input[type=file]');
  };
  const hasFiles = (event) => Array.from(event.dataTransfer?.types ?? []).includes('Files');
  window.addEventListener('dragover', (event) => { if (hasFiles(event)) event.preventDefault(); });
  window.addEventListener('drop', async (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    for (const file of Array.from(event.dataTransfer.files)) {
      const target = input();
      if (!target) return;
      const one = new DataTransfer();
      one.items.add(file);
      target.files = one.files;
      target.dispatchEvent(new Event('change', { bubbles: true }));
      await new Promise((done) => setTimeout(done, 300));
    }
  });
})();
"""


@dataclass
class _Transfer:
    client: int
    filename: str
    bytes: int
    parts: int
    path: Path
    next_part: int = 0
    written: int = 0


class Uploads:
    """Receives what upload buttons of this page send.

    done(path): a file is kept; told(line, button): one was refused, or, with no line, the button's last was kept;
    no button is one that was dropped on the page.  Both are called on the server's thread.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        folder: DataFolder,
        done: Callable[[Path], None],
        told: Callable[[str, Any], None],
        most_bytes: int = PAGE_BYTES,
    ) -> None:
        self.most_bytes = most_bytes
        self._server, self._folder, self._done, self._told = server, folder, done, told
        self._buttons: dict[str, Any] = {}  # by the name that messages give; None where it is unseen
        self._transfers: dict[str, _Transfer] = {}
        self._inside = Inside(server)
        self._inside.take_transfers(self._start, self._part)
        server.on_client_disconnect(lambda client: self._forget(client.client_id))

    def add_button(self, label: str, suffixes: str, **options: Any) -> Any:
        """An upload button at this place of the page; suffixes: ".csv,.mat"."""
        button = self._button(label, suffixes, **options)
        self._buttons[id_of(button)] = button
        return button

    def add_drop(self, suffixes: str) -> None:
        """Lets files be dropped anywhere: through an unseen button here, which must stand outside of all tabs.

        A tab's own button is there only once that tab was opened.
        """
        add_html(self._server.gui, _UNSEEN)
        self._buttons[id_of(self._button("Drop", suffixes))] = None
        self._inside.run(_DROP)

    def _button(self, label: str, suffixes: str, **options: Any) -> Any:
        options.setdefault("hint", f"Up to {megabytes(self.most_bytes)}")
        return self._server.gui.add_upload_button(label, mime_type=suffixes, **options)

    def _start(self, client: int, message: TransferStart) -> None:
        if message.source_component_uuid not in self._buttons or message.transfer_uuid in self._transfers:
            return
        try:
            transfer = self._accepted(client, message)
            transfer.path.touch(exist_ok=False)
        except (InputError, OSError) as error:
            why = f"cannot be kept ({error.strerror})" if isinstance(error, OSError) else str(error)
            self._refuse(client, message.source_component_uuid, message.transfer_uuid, message.size_bytes, why)
            return
        self._transfers[message.transfer_uuid] = transfer
        if transfer.parts == 0:
            self._inside.acknowledge(client, message.source_component_uuid, message.transfer_uuid, 0, 0)
            self._finish(message.transfer_uuid, self._button_of(message.source_component_uuid))

    def _accepted(self, client: int, message: TransferStart) -> _Transfer:
        name = shown(sanitised(str(message.filename)), 100)
        size, parts = message.size_bytes, message.part_count
        if type(size) is not int or type(parts) is not int or not 0 <= parts <= max(size, 0):
            raise InputError(f"{name}: the upload's size makes no sense; try again")
        if size > self.most_bytes:
            limit = f"{size / 1e6:.3g} MB, over the page's limit of {megabytes(self.most_bytes)}"
            advice = f"put the file into {self._folder.folder} and choose it in the list"
            if Path(name).suffix.lower() in FORMATS:
                advice = f"split it, or use emaviz compare on the command line, which takes {megabytes(FILE_BYTES)}"
            raise InputError(f"{name}: {limit}; {advice}")
        on_the_way = sum(transfer.bytes for transfer in self._transfers.values())
        if len(self._transfers) >= _MOST_TRANSFERS or on_the_way + size > 2 * self.most_bytes:
            raise InputError(f"{name}: too many uploads at once; try again when they are done")
        self._folder.place(str(message.filename))  # refused early if the kind of file is wrong
        return _Transfer(client, str(message.filename), size, parts, self._folder.part())

    def _part(self, client: int, message: TransferPart) -> None:
        transfer = self._transfers.get(message.transfer_uuid)
        if transfer is None or transfer.client != client or message.part_index != transfer.next_part:
            return
        transfer.next_part += 1
        transfer.written += len(message.content)
        problem = ""
        if transfer.written > transfer.bytes:
            problem = "the upload is longer than announced; try again"
        elif transfer.next_part == transfer.parts and transfer.written < transfer.bytes:
            problem = "the upload is shorter than announced; try again"
        else:
            try:
                with transfer.path.open("ab") as file:
                    file.write(message.content)
            except OSError as error:
                problem = f"cannot be written ({error.strerror}); check the disk"
        source = message.source_component_uuid
        if problem:
            self._drop(message.transfer_uuid)
            self._refuse(
                client, source, message.transfer_uuid, transfer.bytes, f"{shown(transfer.filename)}: {problem}"
            )
            return
        self._inside.acknowledge(client, source, message.transfer_uuid, transfer.written, transfer.bytes)
        if transfer.next_part == transfer.parts:
            self._finish(message.transfer_uuid, self._button_of(source))

    def _finish(self, uuid: str, button: Any) -> None:
        transfer = self._transfers.pop(uuid)
        try:
            path = self._folder.keep(transfer.path, transfer.filename)
        except InputError as error:
            self._told(str(error), button)
            return
        self._told("", button)
        self._done(path)

    def _button_of(self, source: str | None) -> Any:
        """None of an unseen one."""
        return None if source is None else self._buttons.get(source)

    def _drop(self, uuid: str) -> None:
        transfer = self._transfers.pop(uuid, None)
        if transfer is not None:
            with suppress(OSError):
                transfer.path.unlink()

    def _forget(self, client: int) -> None:
        """What a browser that has gone will not finish."""
        for uuid in [uuid for uuid, transfer in list(self._transfers.items()) if transfer.client == client]:
            self._drop(uuid)

    def _refuse(self, client: int, source: str | None, uuid: str, total: int, line: str) -> None:
        """Tells why, and gives the browser its button back, which waits for the whole file to be acknowledged."""
        self._inside.acknowledge(client, source, uuid, total, total)
        self._told(line, self._button_of(source))
        # the browser's own message says that the upload succeeded
        asyncio.get_running_loop().call_later(_SETTLE_S, self._inside.take_away, client, f"upload-{uuid}")
