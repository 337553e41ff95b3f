"""The server answers this machine's own page, and nobody else."""

from __future__ import annotations

import http.client
import socket

import pytest

from ema_model.errors import InputError
from emaviz.page.server import open_server


@pytest.fixture(scope="module")
def server():
    server = open_server("127.0.0.1", 0)
    yield server
    server.stop()


def ask(server, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=10)
    connection.request("GET", "/", headers=headers)
    response = connection.getresponse()
    body = response.read()
    connection.close()
    return response, body


def upgrade(server, host, origin):
    """The status line that a WebSocket handshake gets."""
    with socket.create_connection(("127.0.0.1", server.get_port()), timeout=10) as plug:
        plug.sendall(
            f"GET / HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nOrigin: {origin}\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        return plug.recv(200).split(b"\r\n")[0].decode()


def test_its_own_page_is_served_with_a_policy(server):
    response, body = ask(server)
    assert response.status == 200 and b"<html" in body.lower()
    policy = response.getheader("Content-Security-Policy")
    assert "default-src 'self'" in policy and "https:" not in policy


def test_a_foreign_host_is_refused(server):
    response, _ = ask(server, Host="evil.example")
    assert response.status == 403


def test_a_foreign_origin_is_refused(server):
    port = server.get_port()
    assert "403" in upgrade(server, f"127.0.0.1:{port}", "http://evil.example")
    assert "403" in upgrade(server, f"127.0.0.1:{port}", f"http://127.0.0.1:{port + 1}")
    assert "403" in upgrade(server, "rebound.example", "http://rebound.example")
    assert "101" in upgrade(server, f"127.0.0.1:{port}", f"http://127.0.0.1:{port}")


def test_it_listens_on_the_loopback_only(server):
    assert server.get_host() == "127.0.0.1"


def test_no_public_tunnel(server):
    assert server.request_share_url() is None


def test_a_taken_port_is_refused_and_not_replaced(server):
    with pytest.raises(InputError, match="in use"):
        open_server("127.0.0.1", server.get_port())


@pytest.mark.parametrize("host, port", [("127.0.0.1", -1), ("127.0.0.1", 70000), ("no.such.host.invalid", 0)])
def test_impossible_addresses_are_refused(host, port):
    with pytest.raises(InputError) as told:
        open_server(host, port)
    assert "\n" not in str(told.value)
