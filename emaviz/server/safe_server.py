"""The page's server, closed to everyone but this page.

viser answers any Host and Origin, so that a web page elsewhere could drive the app; moves to the next port
when one is taken; lets a client open a public tunnel; and believes whatever a browser says.  Here all four are refused.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import functools
import gzip
import http
import inspect
import socket
import threading
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote, unquote, urlsplit

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from ema_model.errors import InputError
from emaviz.server.access import LARGEST_FRAME, Complaints, Door, Gate, protect
from emaviz.server.viser_private import keep_icons

SCENES = "/scenes/"  # below which the actuator's saved scenes are served
RESULTS = "/results/"  # below which files of results are served, as links ask for them
SIGNALS = "/signals"  # where the page's script asks about charts
_OWN_HEADER = "X-Emaviz"  # of such a question: no other page's script can send it without asking first
_opening = threading.Lock()


@dataclass(frozen=True)
class Kept:
    """A file that is sent, or where it is shown instead."""

    body: bytes = b""
    kind: str = ""  # its media type
    save: str = ""  # under which name a browser saves it; "": it is shown
    at: str = ""  # an address that shows it


def open_server(
    host: str,
    port: int,
    door: Door | None = None,
    viewer: Callable[[], str | None] = lambda: None,
    scene: Callable[[str], bytes | None] = lambda _: None,
    signals: Callable[[str], bytes | None] = lambda _: None,
    results: Callable[[str, str], Kept | None] = lambda *_: None,
) -> viser.ViserServer:
    """A viser server on exactly this address; InputError if it cannot be had.

    door: who gets an answer, by default this machine alone; viewer: the address of the Rerun viewer, which the page
    may show, once there is one; scene(name): a page below `SCENES`, or None; signals(query): JSON at `SIGNALS`, or
    None; results(name, query): a file below `RESULTS`, or None.  They are called on threads of their own.
    """
    door = Door(host) if door is None else door
    _check_free(host, port)
    complain = Complaints()
    keep_icons()
    opened: concurrent.futures.Future[viser.ViserServer] = concurrent.futures.Future()
    with _opening:  # viser takes no hook, so its `serve` is wrapped while this server starts
        plain = websockets.asyncio.server.serve

        def guarded(handler: Any, *arguments: Any, process_request: Any = None, **options: Any) -> Any:
            options |= {"max_size": LARGEST_FRAME, "logger": complain.log()}
            guard = _guard(process_request, door, viewer, scene, signals, results)
            return plain(_listening(handler, opened, complain), *arguments, process_request=guard, **options)

        websockets.asyncio.server.serve = guarded  # type: ignore[assignment]
        try:
            server = viser.ViserServer(host=host, port=port, label="emaviz", verbose=False)
        except BaseException:
            opened.cancel()
            raise
        finally:
            websockets.asyncio.server.serve = plain
    if port and server.get_port() != port:
        opened.cancel()
        server.stop()
        raise InputError(f"port {port} is in use; choose another with --port, or 0 for any free one")
    server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
    opened.set_result(server)
    return server


def _check_free(host: str, port: int) -> None:
    if not 0 <= port <= 65535:
        raise InputError(f"port {port} is not a port; choose 1 … 65535, or 0 for any free one")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except socket.gaierror:
        raise InputError(f"--host {host}: no such address on this machine") from None
    except PermissionError:
        raise InputError(f"port {port} needs more rights; choose one above 1023 with --port") from None
    except OSError as error:
        if error.errno in (98, 48, 10048):  # EADDRINUSE on Linux, macOS, Windows
            raise InputError(f"port {port} is in use; choose another with --port, or 0 for any free one") from None
        raise InputError(f"--host {host}: cannot listen there ({error.strerror})") from None


def _listening(
    handler: Callable[[ServerConnection], Awaitable[None]],
    opened: concurrent.futures.Future[viser.ViserServer],
    complain: Complaints,
) -> Callable[[ServerConnection], Awaitable[None]]:
    """viser's handler of a connection, which hears only what the gate lets through."""
    expected = f"viser-v{viser.__version__}"

    async def listen(connection: ServerConnection) -> None:
        if connection.subprotocol != expected:  # a tab left open by another version of viser reads this, and says it
            complain(f"a page of another version was turned away: {connection.subprotocol or 'it names none'}")
            await connection.close(1002, f"Version mismatch. Server: {viser.__version__}; reload the page")
            return
        server = await asyncio.wrap_future(opened)  # a tab left open is here before the server is complete
        connection.recv = Gate(server, connection, complain).recv  # type: ignore[method-assign]
        await handler(connection)

    return listen


def _guard(
    inner: Callable[..., Any] | None,
    door: Door,
    viewer: Callable[[], str | None],
    scene: Callable[[str], bytes | None],
    signals: Callable[[str], bytes | None],
    results: Callable[[str, str], Kept | None],
) -> Callable[..., Awaitable[Response | None]]:
    async def process_request(connection: ServerConnection, request: Request) -> Response | None:
        port = connection.local_address[1]
        refusal = door.refusal(request.path, request.headers, port)
        if refusal is not None:
            return _refused(refusal)
        asked = urlsplit(request.path)
        path = unquote(asked.path)
        if path.startswith(SCENES):
            response = _answer(await asyncio.to_thread(scene, path.removeprefix(SCENES)), "text/html", "scene")
        elif path == SIGNALS:
            own = _OWN_HEADER in request.headers
            response = _answer(
                await asyncio.to_thread(signals, asked.query) if own else None, "application/json", "chart"
            )
        elif path.startswith(RESULTS):
            foreign = request.headers.get("Sec-Fetch-Site") == "cross-site"  # another page's link writes nothing here
            name = path.removeprefix(RESULTS)
            response = _sent(None if foreign else await asyncio.to_thread(results, name, asked.query))
        else:
            response = None if inner is None else inner(connection, request)
        if inspect.isawaitable(response):
            response = await response
        if response is not None:
            _name(response)
            shown = viewer() if door.asked_here(request.headers) else None
            protect(response.headers, door.asked(request.headers) or "", shown)
            if door.token and door.brings_token(request.path):
                response.headers["Set-Cookie"] = door.cookie(port)
        return response

    return process_request


# Without a GPU a smooth edge costs a third of all that a picture of the actuator takes: motion comes first there.
_EDGES = b"""<script>(() => {
  const get = HTMLCanvasElement.prototype.getContext;
  let slow = null;
  const by = () => {
    const gl = get.call(document.createElement('canvas'), 'webgl');
    const told = gl?.getExtension('WEBGL_debug_renderer_info');
    return told ? gl.getParameter(told.UNMASKED_RENDERER_WEBGL) : '';
  };
  HTMLCanvasElement.prototype.getContext = function (kind, asked) {
    if (/^webgl/.test(kind) && asked?.antialias && (slow ??= /llvmpipe|swiftshader|software|basic render/i.test(by())))
      asked = { ...asked, antialias: false };
    return get.call(this, kind, asked);
  };
})();</script>"""


def _name(response: Response) -> None:
    """Gives viser's page the app's name, before its script has a more exact one, and edges that a machine can draw."""
    if not response.headers.get("Content-Type", "").startswith("text/html"):
        return
    response.body = _named(bytes(response.body), response.headers.get("Content-Encoding") == "gzip")
    if "Content-Length" in response.headers:
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))


@functools.lru_cache(maxsize=4)
def _named(body: bytes, zipped: bool) -> bytes:
    plain = gzip.decompress(body) if zipped else body
    named = plain.replace(b"<title>Viser</title>", b"<title>emaviz</title>" + _EDGES, 1)
    return gzip.compress(named, compresslevel=1, mtime=0) if zipped else named


def _sent(kept: Kept | None) -> Response:
    """A result's file, or the way to where it is shown."""
    if kept is None or not kept.at:
        response = _answer(None if kept is None else kept.body, "" if kept is None else kept.kind, "result")
        if kept is not None and kept.save:
            response.headers["Content-Disposition"] = f"attachment; filename*=UTF-8''{quote(kept.save)}"
        return response
    status = http.HTTPStatus.SEE_OTHER
    headers = Headers({"Location": kept.at, "Content-Length": "0", "Connection": "close", "Cache-Control": "no-store"})
    return Response(status, status.phrase, headers, b"")


def _answer(body: bytes | None, kind: str, what: str) -> Response:
    """An answer of ours, or that there is no such thing."""
    status = http.HTTPStatus.OK if body is not None else http.HTTPStatus.NOT_FOUND
    if body is None:
        body, kind = f"There is no such {what}.\n".encode(), "text/plain"
    headers = Headers(
        {"Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(body)), "Connection": "close"}
    )
    return Response(status, status.phrase, headers, body)


def _refused(reason: str) -> Response:
    body = f"Refused: {reason}.\n".encode()
    headers = Headers({"Content-Type": "text/plain", "Content-Length": str(len(body)), "Connection": "close"})
    return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", headers, body)
