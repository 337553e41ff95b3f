"""The server answers this machine's own page, and nobody else."""

from __future__ import annotations

import http.client

import pytest

from ema_model.errors import InputError
from emaviz.server.access import Door
from emaviz.server.safe_server import open_server


@pytest.fixture(scope="module")
def server():
    server = open_server("127.0.0.1", 0)
    yield server
    server.stop()


def ask(server, path="/", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=10)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    body = response.read()
    connection.close()
    return response, body


def directives(response):
    """The page's policy, by directive."""
    parts = [one.split() for one in response.getheader("Content-Security-Policy").split(";")]
    return {name: set(sources) for name, *sources in parts}


def test_the_page_may_speak_to_its_own_server_and_show_the_viewer_only():
    viewer = []
    server = open_server("127.0.0.1", 0, viewer=lambda: viewer[0] if viewer else None)
    try:
        own = f"localhost:{server.get_port()}"
        response, body = ask(server, Host=own)
        assert response.status == 200 and b"<html" in body.lower()
        policy = directives(response)
        assert policy["connect-src"] == {"'self'", "blob:", "data:", f"ws://{own}"}
        assert policy["frame-src"] == {"'self'"} and policy["frame-ancestors"] == {"'self'"}
        assert policy["default-src"] == {"'self'", "'unsafe-inline'", "'unsafe-eval'", "blob:", "data:"}
        assert policy["object-src"] == policy["base-uri"] == policy["form-action"] == {"'none'"}
        viewer.append("http://127.0.0.1:4711")
        assert directives(ask(server, Host=own)[0])["frame-src"] == {"'self'", "http://127.0.0.1:4711"}
        assert response.getheader("Referrer-Policy") == "no-referrer"
    finally:
        server.stop()


def test_a_page_from_elsewhere_frames_nothing_of_its_own_machine():
    door = Door("127.0.0.1", ["rig.example.org"])
    server = open_server("127.0.0.1", 0, door, lambda: "http://127.0.0.1:4711")
    try:
        policy = directives(ask(server, f"/?token={door.token}", Host="rig.example.org")[0])
        assert policy["frame-src"] == {"'self'"} and "ws://rig.example.org:80" in policy["connect-src"]
        policy = directives(ask(server, f"/?token={door.token}", Host="[::1]:8080")[0])
        assert policy["frame-src"] == {"'self'", "http://127.0.0.1:4711"}
        assert policy["connect-src"] == {"'self'", "blob:", "data:"}, "a policy knows no IPv6 addresses"
        assert ask(server, Host="rig.example.org")[0].status == 403
    finally:
        server.stop()


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
