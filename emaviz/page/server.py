"""The page's server, closed to everyone but this page.

viser answers any Host and Origin, so that a web page elsewhere could drive the app; moves to the next port
when one is taken; and lets a client open a public tunnel.  Here all three are refused.
"""

from __future__ import annotations

import http
import inspect
import socket
import threading
from collections.abc import Awaitable, Callable
from typing import Any
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from ema_model.errors import InputError

LOOPBACK = ("127.0.0.1", "localhost", "::1")
# All that the client needs is in its own page; blob: and data: are its workers, textures and saved files.
_POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    "connect-src 'self' blob: data: ws: http://127.0.0.1:* http://localhost:*; "
    "frame-src 'self' http://127.0.0.1:*; frame-ancestors 'self'; object-src 'none'"
)
_opening = threading.Lock()


def open_server(host: str, port: int) -> viser.ViserServer:
    """A viser server on exactly this address; InputError if it cannot be had."""
    _check_free(host, port)
    with _opening:  # viser takes no hook, so its `serve` is wrapped while this server starts
        plain = websockets.asyncio.server.serve
        allowed = _allowed_names(host)

        def guarded(handler: Any, *arguments: Any, process_request: Any = None, **options: Any) -> Any:
            return plain(handler, *arguments, process_request=_guard(process_request, allowed), **options)

        websockets.asyncio.server.serve = guarded  # type: ignore[assignment]
        try:
            server = viser.ViserServer(host=host, port=port, label="emaviz", verbose=False)
        finally:
            websockets.asyncio.server.serve = plain
    if port and server.get_port() != port:
        server.stop()
        raise InputError(f"port {port} is in use; choose another with --port, or 0 for any free one")
    server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
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


def _allowed_names(host: str) -> frozenset[str] | None:
    """Names under which a browser may ask; None (any) when the user opens the server to a network."""
    return frozenset((*LOOPBACK, host)) if host in LOOPBACK else None


def _guard(
    inner: Callable[..., Any] | None, allowed: frozenset[str] | None
) -> Callable[..., Awaitable[Response | None]]:
    async def process_request(connection: Any, request: Request) -> Response | None:
        host = request.headers.get("Host", "")
        origin = request.headers.get("Origin")
        if allowed is not None and urlsplit(f"//{host}").hostname not in allowed:
            return _refusal("this server answers to its own address only")
        if origin is not None and urlsplit(origin).netloc != host:
            return _refusal("requests from other pages are refused")
        response = None if inner is None else inner(connection, request)
        if inspect.isawaitable(response):
            response = await response
        if response is not None:
            response.headers["Content-Security-Policy"] = _POLICY
            response.headers["X-Content-Type-Options"] = "nosniff"
        return response

    return process_request


def _refusal(reason: str) -> Response:
    body = f"Refused: {reason}.\n".encode()
    headers = Headers({"Content-Type": "text/plain", "Content-Length": str(len(body)), "Connection": "close"})
    return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", headers, body)
