"""The Rerun viewer, served to this machine with its assets."""

from __future__ import annotations

import gzip
import hashlib
import re
import shutil
import socketserver
import tempfile
import threading
import urllib.request
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote, urlsplit

from ema_model.files.written import FileLock, lock_path
from emaviz.recording.entry import RecordingError, part_of
from emaviz.recording.read import check, started

# --- the Rerun web viewer's files, as they ship in the wheel (43 MB, inside the program) ------------------------------

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
# The viewer asks its makers' servers for news and sends them telemetry. The page's policy refuses that, which is an
# error in the console each time: here it has an empty answer before it is asked.
_AT_HOME = b"""<script>
{ const asked = window.fetch;
  window.fetch = (what, how) => {
    const { protocol, hostname } = new URL(what.url ?? what, location.href);
    const here = ['127.0.0.1', 'localhost'].includes(hostname) || !protocol.startsWith('http');
    return here ? asked(what, how) : Promise.resolve(new Response('{}', { status: 404 }));
  };
}
</script>"""
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
    with started(*arguments) as process:
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
    """The viewer's page without its makers' fonts and servers, under the app's name."""
    title = b"<title>Recording \xe2\x80\x93 emaviz</title>" + _AT_HOME
    return _TITLE.sub(lambda _: title, _ABROAD.sub(b"", body), count=1)


# --- hosts the Rerun web viewer and recordings on the loopback interface, without any other network -------------------

_FOLDER = "/recordings/"
_FOLLOW_S = 0.1  # between two looks at a recording that grows
_CLOSED_S = 0.1  # after which it is seen at the latest that the host is to end
_CSP = "; ".join(
    (
        "default-src 'self'",
        # The viewer would otherwise call its makers' servers for telemetry and news.
        "connect-src 'self' blob: data: http://127.0.0.1:*",
        "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' blob: data:",
        "worker-src 'self' blob:",
        "frame-ancestors 'self' http://127.0.0.1:* http://localhost:*",
        "object-src 'none'; base-uri 'none'; form-action 'none'",
    )
)


class ViewerHost:
    """Serves the viewer and the .rrd files of one folder to browsers on this machine, until `close`.

    A recording that is still being written is served as it grows, so that the viewer shows it live.

    The viewer's files are fetched from the installed rerun-sdk on the first request.
    """

    def __init__(self, folder: str | Path, *, port: int = 0, only: str | None = None) -> None:
        """port 0 takes a free one; only: the single file to serve.  RecordingError: no folder, port taken."""
        self.folder = Path(folder).resolve()
        self.only = only
        if not self.folder.is_dir():
            raise RecordingError(f"{folder}: no such folder")
        try:
            self._server = _Server(("127.0.0.1", port), _Handler)
        except (OSError, OverflowError) as error:
            why = error.strerror.lower() if isinstance(error, OSError) and error.strerror else str(error)
            raise RecordingError(f"port {port} cannot be used: {why}; choose another, or 0 for a free one") from error
        self.closing = threading.Event()
        self._server.host = self
        self.port: int = self._server.server_address[1]
        self.address = f"http://127.0.0.1:{self.port}"
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(_CLOSED_S,), name="rerun-viewer", daemon=True
        )
        self._thread.start()

    def __enter__(self) -> ViewerHost:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def check(self) -> None:
        """RecordingError if the viewer's own files cannot be had, so that a browser would be shown nothing."""
        viewer_assets()

    def url_of(self, name: str) -> str:
        """The address at which a browser shows this recording of the folder."""
        file = quote(f"{self.address}{_FOLDER}{quote(name, safe='')}", safe="")
        return f"{self.address}/?url={file}&hide_welcome_screen=1&persist=0&notebook=0"

    def find(self, name: str) -> Path | None:
        """The recording of that name, if it lies in the folder itself and may be served."""
        if Path(name).name != name or not name.endswith(".rrd") or "\0" in name or self.only not in (None, name):
            return None
        path = (self.folder / name).resolve()  # a link could lead outside
        return path if path.parent == self.folder and path.is_file() else None

    def find_growing(self, name: str) -> Path | None:
        """The part of the recording that will have that name, while it is being written."""
        if Path(name).name != name or not name.endswith(".rrd") or "\0" in name or self.only not in (None, name):
            return None
        part = part_of(self.folder / name)
        return part if part.is_file() and not part.is_symlink() and FileLock.is_held(lock_path(part)) else None

    def close(self) -> None:
        """Stops serving and frees the port."""
        self.closing.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(5.0)

    def wait(self) -> None:
        """Returns when the server has stopped."""
        self._thread.join()


def view(path: str | Path, open_browser: bool = True, port: int = 0) -> None:
    """Shows one recording in the browser until Ctrl-C; prints the address.  RecordingError if it cannot.

    Of one that was cut off (.part), or is being written, it shows what is there now.
    """
    path = Path(path)
    try:
        with _viewable(path) as file, ViewerHost(file.parent, port=port, only=file.name) as host:
            address = host.url_of(file.name)
            print(f"{path.name}: {address}\nCtrl-C ends it.", flush=True)
            if open_browser:
                webbrowser.open(address)
            host.wait()
    except KeyboardInterrupt:
        return


@contextmanager
def _viewable(path: Path) -> Iterator[Path]:
    """The recording itself, or a whole copy of a part for as long as it is shown."""
    if path.suffix == ".rrd":
        yield check(path)
        return
    if path.suffix != ".part":
        raise RecordingError(f"{path}: the name of a recording must end in .rrd, or in .part if it was cut off")
    from emaviz.recording.read import write_whole  # rerun takes a second to import

    with tempfile.TemporaryDirectory(prefix="emaviz-") as folder:
        copy = Path(folder, path.with_suffix("").name).with_suffix(".rrd")
        write_whole(path, copy)
        yield copy


class _Server(socketserver.ThreadingMixIn, socketserver.TCPServer):
    """A thread a request; none outlives the process."""

    daemon_threads = True
    allow_reuse_address = True
    block_on_close = False
    host: ViewerHost

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away in the middle is no error worth a traceback."""


class _Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD; everything else is refused by the base class."""

    server: _Server
    protocol_version = "HTTP/1.1"
    timeout = 30
    server_version = "emaviz"
    sys_version = ""

    def do_GET(self) -> None:
        """The viewer's files and the recordings."""
        # A page elsewhere could otherwise reach us under a name of its own that resolves to this machine.
        if self.headers.get("Host") not in (f"127.0.0.1:{self.server.host.port}", f"localhost:{self.server.host.port}"):
            self._refuse(HTTPStatus.FORBIDDEN, "wrong host")
            return
        path = urlsplit(self.path).path
        if path.startswith(_FOLDER):
            self._recording(unquote(path.removeprefix(_FOLDER)))
        else:
            self._asset(path.removeprefix("/") or "index.html")

    do_HEAD = do_GET

    def _asset(self, name: str) -> None:
        try:
            asset = viewer_assets().get(name)
        except RecordingError as error:
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, str(error))
            return
        if asset is None:
            self._refuse(HTTPStatus.NOT_FOUND, "no such page")
            return
        common = {"ETag": asset.tag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
        if self.headers.get("If-None-Match") == asset.tag:
            self._head(HTTPStatus.NOT_MODIFIED, common)
            return
        body = asset.body
        if "gzip" in self.headers.get("Accept-Encoding", ""):
            body = asset.compressed
            common["Content-Encoding"] = "gzip"
        # By the last header the viewer's page knows how much is still to come.
        length = {"Content-Length": str(len(body)), "rerun-final-length": str(len(asset.body))}
        self._head(HTTPStatus.OK, {"Content-Type": asset.content_type, **length, **common})
        if self.command == "GET":
            self.wfile.write(body)

    def _recording(self, name: str) -> None:
        path = self.server.host.find(name)
        if path is None and (growing := self.server.host.find_growing(name)) is not None:
            self._follow(growing)
            return
        if path is None:
            self._refuse(HTTPStatus.NOT_FOUND, "no such recording")
            return
        with path.open("rb") as file:
            size = path.stat().st_size
            headers = {"Content-Type": "application/octet-stream", "Content-Length": str(size)}
            self._head(HTTPStatus.OK, {**headers, "Cache-Control": "no-store"})
            if self.command == "GET":
                shutil.copyfileobj(file, self.wfile, 1 << 20)

    def _follow(self, part: Path) -> None:
        """A recording that is being written, as it grows, until its writer is done with it."""
        lock = lock_path(part)
        with part.open("rb") as file:  # stays the same file when it gets its name
            headers = {"Content-Type": "application/octet-stream", "Connection": "close", "Cache-Control": "no-store"}
            self._head(HTTPStatus.OK, headers)
            self.close_connection = True
            while self.command == "GET":
                done = not (part.exists() and FileLock.is_held(lock)) or self.server.host.closing.is_set()
                while chunk := file.read(1 << 16):
                    self.wfile.write(chunk)
                if done:
                    return
                self.server.host.closing.wait(_FOLLOW_S)

    def _refuse(self, status: HTTPStatus, message: str) -> None:
        body = f"{status.value}: {message}\n".encode()
        self._head(status, {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))})
        if self.command == "GET":
            self.wfile.write(body)

    def _head(self, status: HTTPStatus, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Security-Policy", _CSP)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Silent."""
