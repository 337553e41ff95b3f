"""The Rerun web viewer's files, as they ship in the wheel (43 MB, inside the program)."""

from __future__ import annotations

import gzip
import hashlib
import re
import threading
import urllib.request
from dataclasses import dataclass, field
from functools import cached_property

from emaviz.recording import binary
from emaviz.recording.errors import RecordingError

_TYPES = {
    "index.html": "text/html; charset=utf-8",
    "re_viewer.js": "text/javascript; charset=utf-8",
    "re_viewer_bg.wasm": "application/wasm",
    "favicon.ico": "image/x-icon",
}
_ADDRESS = re.compile(r"Hosting a web-viewer at (http://127\.0\.0\.1:\d+)")
# Links to its makers' fonts: refused as a style sheet, which is an error in the console, but not as a connection.
_ABROAD = re.compile(rb"\s*<link\b[^>]*https?://[^>]*>")
_TITLE = re.compile(rb"<title>[^<]*</title>")
_TIMEOUT_S = 20.0


@dataclass
class Asset:
    """One file of the viewer."""

    content_type: str
    body: bytes = field(repr=False)

    @cached_property
    def compressed(self) -> bytes:
        """Gzipped at the lightest setting, which takes the 43 MB in half a second."""
        return gzip.compress(self.body, compresslevel=1, mtime=0)

    @cached_property
    def tag(self) -> str:
        """The same as long as the content is: lets a browser keep its copy."""
        return f'"{hashlib.sha256(self.body).hexdigest()[:24]}"'


_lock = threading.Lock()
_assets: dict[str, Asset] = {}


def viewer_assets() -> dict[str, Asset]:
    """The files by name, fetched once for this process (about half a second).  RecordingError if that fails."""
    with _lock:
        if not _assets:
            _assets.update(_fetch())
        return _assets


def _fetch() -> dict[str, Asset]:
    """Starts the program's own server on the loopback interface, for as long as it takes to copy its files.

    Given an address to show, it opens no port for logging; nothing ever asks for that address.
    """
    arguments = ("--serve-web", "--bind", "127.0.0.1", "--web-viewer-port", "0", "http://127.0.0.1:1/none.rrd")
    with binary.started(*arguments) as process:
        clock = threading.Timer(_TIMEOUT_S, process.kill)
        clock.daemon = True
        clock.start()
        try:
            return {name: Asset(kind, body) for name, kind, body in _copy(_address(process.stderr))}
        except OSError as error:
            raise RecordingError(f"the Rerun viewer's files cannot be had from rerun-sdk: {error}") from error
        finally:
            clock.cancel()


def _address(messages) -> str:
    for line in messages:
        found = _ADDRESS.search(line)
        if found:
            return found[1]
    raise OSError("its server did not start")


def _copy(address: str):
    # No proxy: the address is on this machine.
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    for name, kind in _TYPES.items():
        with opener.open(f"{address}/{name}", timeout=_TIMEOUT_S) as answer:
            body = answer.read()
            yield name, kind, _page(body) if name == "index.html" else body


def _page(body: bytes) -> bytes:
    """The viewer's page without its makers' fonts, under the app's name."""
    return _TITLE.sub(b"<title>Recording \xe2\x80\x93 emaviz</title>", _ABROAD.sub(b"", body), count=1)
