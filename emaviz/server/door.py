"""Who gets an answer: this machine's own page; from a network, who asks by an allowed name and has the token."""

from __future__ import annotations

import hmac
import re
import secrets
from collections.abc import Sequence
from ipaddress import ip_address
from urllib.parse import parse_qs

from websockets.datastructures import Headers

from ema_model.errors import InputError
from ema_model.files.refusal import shown

_NAME = re.compile(r"[a-z0-9_]([a-z0-9_.-]{0,251}[a-z0-9_])?")
_NETLOC = re.compile(r"(?P<name>\[[0-9a-f:.]+\]|[a-z0-9_-]+(\.[a-z0-9_-]+)*\.?)(:(?P<port>[0-9]{0,5}))?")
_PORTS = {"http": 80, "https": 443}


class Door:
    """Of a server on one address; `token` is None on the loopback, where no other machine can come."""

    def __init__(self, host: str, allow_hosts: Sequence[str] = ()) -> None:
        """allow_hosts: names or addresses, without port, by which other machines ask.  InputError: they do not fit."""
        for name in allow_hosts:
            if not _NAME.fullmatch(_bare(name)) and not _is_address(name):
                raise InputError(f"--allow-host {shown(name)}: give a bare name or address, such as rig.example.org")
        if not is_loopback(host) and not allow_hosts:
            raise InputError(
                f"--host {shown(host)} opens the app to the network: add --allow-host NAME, "
                "the name or address that goes into the browser's address bar"
            )
        self.host = host
        self._everywhere = not host or (_is_address(host) and ip_address(_bare(host)).is_unspecified)
        own = [] if self._everywhere else [host]
        self._names = frozenset(_bare(name) for name in (*own, *allow_hosts))
        self._first = allow_hosts[0] if allow_hosts else host
        self.token = secrets.token_urlsafe(32) if allow_hosts else None

    def address(self, port: int) -> str:
        """Where others find the page."""
        return f"http://{_netloc(self._first, port)}"

    def entry(self, port: int, here: bool = False) -> str:
        """The address to open first, with its token; here: by a browser on this machine."""
        name = self._first
        if here:
            name = self.host if not self._everywhere else "::1" if ":" in self.host else "127.0.0.1"
        return f"http://{_netloc(name, port)}" + (f"/?token={self.token}" if self.token else "")

    def asked(self, headers: Headers) -> str | None:
        """The host and port by which a browser asks, as in an address; None if they are not ours."""
        hosts = headers.get_all("Host")
        found = _split(hosts[0]) if len(hosts) == 1 else None
        if found is None or not (found[0] in self._names or is_loopback(found[0])):
            return None
        return _netloc(*found)

    def asked_here(self, headers: Headers) -> bool:
        """Whether the browser asked by a name of the loopback, so that it reaches what else listens there."""
        host = self.asked(headers)
        return host is not None and is_loopback(host.rpartition(":")[0])

    def refusal(self, path: str, headers: Headers, port: int) -> str | None:
        """Why this request gets no answer, or None; path: with its query, port: of this server."""
        if self.asked(headers) is None:
            return "this server answers to its own address only"
        for origin in headers.get_all("Origin"):
            scheme, _, there = origin.partition("://")
            if scheme not in _PORTS or _split(there, _PORTS[scheme]) != _split(headers["Host"], _PORTS[scheme]):
                return "requests from other pages are refused"
        if self.token and not self.brings_token(path) and not self._has_cookie(headers, port):
            return "open the address that the app printed when it started, with its token"
        return None

    def brings_token(self, path: str) -> bool:
        """Whether the token stands in the address."""
        return any(self._is_token(one) for one in parse_qs(path.partition("?")[2]).get("token", ()))

    def cookie(self, port: int) -> str:
        """What the browser keeps in the token's place; of this port, as cookies are shared among ports."""
        return f"emaviz-{port}={self.token}; HttpOnly; SameSite=Strict; Path=/"

    def _has_cookie(self, headers: Headers, port: int) -> bool:
        pairs = [part.strip().partition("=") for line in headers.get_all("Cookie") for part in line.split(";")]
        return any(name == f"emaviz-{port}" and self._is_token(value) for name, _, value in pairs)

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode("utf-8", "replace"), str(self.token).encode())


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches that name or address."""
    return _bare(host) == "localhost" or (_is_address(host) and ip_address(_bare(host)).is_loopback)


def _bare(name: str) -> str:
    """Without brackets, the root's dot, and capitals."""
    return name.lower().removeprefix("[").removesuffix("]").removesuffix(".")


def _is_address(name: str) -> bool:
    try:
        ip_address(_bare(name))
    except ValueError:
        return False
    return True


def _split(netloc: str, default: int = 80) -> tuple[str, int] | None:
    """Name and port; None if it is no such thing."""
    found = _NETLOC.fullmatch(netloc.lower())
    if found is None:
        return None
    port = int(found["port"] or default)
    return (_bare(found["name"]), port) if port <= 65535 else None


def _netloc(name: str, port: int) -> str:
    name = _bare(name)
    return f"[{name}]:{port}" if ":" in name else f"{name}:{port}"
