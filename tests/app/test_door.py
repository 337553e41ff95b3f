"""Who gets an answer: by raw requests, as a browser or anybody else could send them."""

from __future__ import annotations

import socket
import urllib.request

import pytest
import viser
from support.on_page import wait_until
from support.raw_page import RawPage

from ema_model.errors import InputError
from emaviz.cli import main
from emaviz.page.app import App
from emaviz.server.access import Door, is_loopback
from emaviz.server.safe_server import open_server


def request(port, *headers, path="/", upgrade=False):
    """The answer to a request with exactly these headers, as (status line, its headers)."""
    lines = [f"GET {path} HTTP/1.1", *headers]
    if upgrade:
        lines += ["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="]
        lines += ["Sec-WebSocket-Version: 13", f"Sec-WebSocket-Protocol: viser-v{viser.__version__}"]
    with socket.create_connection(("127.0.0.1", port), timeout=10) as plug:
        plug.sendall("\r\n".join([*lines, "", ""]).encode("latin-1"))
        head = b""
        while b"\r\n\r\n" not in head and (more := plug.recv(4096)):
            head += more
    status, *rest = head.partition(b"\r\n\r\n")[0].decode("latin-1").split("\r\n")
    return status, dict(line.split(": ", 1) for line in rest)


def answered(*arguments, **options):
    """Whether the request got a page or a websocket; anything else must be a plain refusal."""
    status = request(*arguments, **options)[0]
    assert status.split()[1] in ("101", "200", "403"), status
    return "403" not in status


@pytest.fixture(scope="module")
def port():
    server = open_server("127.0.0.1", 0)
    yield server.get_port()
    server.stop()


@pytest.fixture(scope="module")
def open_door():
    return Door("0.0.0.0", ["rig.example.org", "10.1.2.3", "fd00::7"])


@pytest.fixture(scope="module")
def open_port(open_door):
    """Of a server that is open to a network."""
    server = open_server("0.0.0.0", 0, open_door)
    yield server.get_port()
    server.stop()


OWN = ["127.0.0.1", "localhost", "LOCALHOST", "LocalHost", "localhost.", "127.0.0.2", "127.255.255.254", "[::1]"]
FOREIGN = [
    *("evil.example", "rig.example.org", "10.1.2.3", "[fd00::7]", "0.0.0.0", "[::]", "[::2]", "::1", "128.0.0.1"),
    *("localhost.evil.example", "evil.example[::1]", "[::1]evil.example", "127.0.0.1.evil.example", "localhost..", ""),
    *("localhost@evil.example", "evil.example@localhost", "localhost#", "localhost/x", "local host", "127.0.0.1;x"),
    *("127.0.0.1,evil.example", "localhost:abc", "localhost:99999", "localhost:-1", "löcalhost", "[::1", "[]"),
]


@pytest.mark.parametrize("upgrade", [False, True])
def test_it_answers_to_its_own_names_only(port, upgrade):
    for host in OWN:
        for one in (host, f"{host}:{port}", f"{host}:"):
            assert answered(port, f"Host: {one}", upgrade=upgrade), one
    for host in FOREIGN:
        for one in (host, f"{host}:{port}"):
            assert not answered(port, f"Host: {one}", upgrade=upgrade), one
    assert not answered(port, upgrade=upgrade)
    assert not answered(port, "Host: localhost", "Host: localhost", upgrade=upgrade)


def test_another_origin_is_refused(port):
    host = f"Host: localhost:{port}"
    for origin in (f"http://localhost:{port}", f"http://LOCALHOST:{port}", f"http://localhost.:{port}"):
        assert answered(port, host, f"Origin: {origin}", upgrade=True), origin
    for origin in (
        *("null", "", "http://", "file://", f"http://127.0.0.1:{port}", f"http://localhost:{port + 1}"),
        *(f"ftp://localhost:{port}", "http://localhost", f"http://evil.example:{port}", f"http://x@localhost:{port}"),
    ):
        assert not answered(port, host, f"Origin: {origin}", upgrade=True), origin
    assert not answered(port, host, f"Origin: http://localhost:{port}", "Origin: http://evil.example", upgrade=True)
    assert answered(port, "Host: localhost", "Origin: http://localhost:80", upgrade=True), "the same port, written out"


@pytest.mark.parametrize("upgrade", [False, True])
def test_from_a_network_only_the_token_or_its_cookie_opens(open_port, open_door, upgrade):
    token, host = open_door.token, f"Host: rig.example.org:{open_port}"
    good = f"Cookie: emaviz-{open_port}={token}"
    assert answered(open_port, host, path=f"/?token={token}", upgrade=upgrade)
    assert answered(open_port, host, path=f"/?a=b&token={token}&c", upgrade=upgrade)
    assert answered(open_port, host, good, upgrade=upgrade)
    assert answered(open_port, host, f"Cookie: a=b; emaviz-{open_port}={token}; c", upgrade=upgrade)
    assert answered(open_port, host, "Cookie: broken", good, path="/?token=wrong", upgrade=upgrade)
    for path in ("/", "/?", "/?token=", "/?token", f"/?token={token[:-1]}", f"/?token={token}x", f"/?Token={token}"):
        assert not answered(open_port, host, path=path, upgrade=upgrade), path
    assert not answered(open_port, host, path="/?token=%ff%00é", upgrade=upgrade)
    for cookie in ("", "=", ";;", f"emaviz-{open_port}=", f"emaviz-{open_port}={token}x", f"emaviz-1={token}", "\xff"):
        assert not answered(open_port, host, f"Cookie: {cookie}", upgrade=upgrade), cookie


def test_the_token_opens_to_no_other_name_or_page(open_port, open_door):
    path = f"/?token={open_door.token}"
    for host in (*OWN, "RIG.example.org", "rig.example.org.", "10.1.2.3", "[fd00::7]", "[FD00::7]"):
        assert answered(open_port, f"Host: {host}:{open_port}", path=path), host
    for host in ("0.0.0.0", "evil.example", "x.rig.example.org", "10.1.2.4", "[fd00::8]"):
        assert not answered(open_port, f"Host: {host}:{open_port}", path=path), host
    host = f"Host: rig.example.org:{open_port}"
    assert answered(open_port, host, f"Origin: http://rig.example.org:{open_port}", path=path, upgrade=True)
    assert not answered(open_port, host, "Origin: http://evil.example", path=path, upgrade=True)
    proxied = ("Host: rig.example.org", "Origin: https://rig.example.org")
    assert answered(open_port, *proxied, path=path, upgrade=True), "behind a proxy that encrypts"


def test_the_first_visit_sets_the_cookie(open_port, open_door):
    host = f"Host: rig.example.org:{open_port}"
    _, headers = request(open_port, host, path=f"/?token={open_door.token}")
    cookie, *flags = headers["Set-Cookie"].split("; ")
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} == set(flags)
    _, later = request(open_port, host, f"Cookie: {cookie}")
    assert "Set-Cookie" not in later
    assert "Set-Cookie" not in request(open_port, host)[1]


def test_tokens_differ_and_the_loopback_needs_none(port):
    assert Door("0.0.0.0", ["rig"]).token != Door("0.0.0.0", ["rig"]).token
    assert len(str(Door("0.0.0.0", ["rig"]).token)) >= 40
    assert Door("127.0.0.1").token is None and Door("127.0.0.1").entry(80) == "http://127.0.0.1:80"
    assert Door("127.0.0.1", ["rig.example.org"]).token, "somebody forwards it to a network"


def test_the_addresses_that_are_printed_and_opened():
    door = Door("0.0.0.0", ["rig.example.org", "10.1.2.3"])
    assert door.entry(8080) == f"http://rig.example.org:8080/?token={door.token}"
    assert door.entry(8080, here=True) == f"http://127.0.0.1:8080/?token={door.token}"
    assert Door("::", ["fd00::7"]).address(8080) == "http://[fd00::7]:8080"
    assert Door("10.1.2.3", ["rig"]).entry(80, here=True).startswith("http://10.1.2.3:80/?token=")
    assert Door("::1").address(8080) == "http://[::1]:8080"


def test_what_counts_as_this_machine():
    for host in ("127.0.0.1", "127.0.0.2", "127.255.0.1", "::1", "[::1]", "localhost", "LOCALHOST", "localhost."):
        assert is_loopback(host), host
    for host in ("0.0.0.0", "::", "", "10.0.0.1", "128.0.0.1", "localhost.evil.example", "127.0.0.1.evil.example"):
        assert not is_loopback(host), host


@pytest.mark.parametrize("host", ["127.0.0.2", "LOCALHOST"])
def test_every_name_of_the_loopback_can_be_listened_on(host):
    server = open_server(host, 0)
    try:
        answer = urllib.request.build_opener(urllib.request.ProxyHandler({})).open(
            f"http://{host}:{server.get_port()}/", timeout=10
        )
        with answer:
            assert answer.status == 200
    finally:
        server.stop()


@pytest.mark.parametrize("host", ["0.0.0.0", "10.1.2.3", "rig.example.org", "::", ""])
def test_the_network_is_not_opened_by_accident(host, tmp_path, capsys):
    with pytest.raises(InputError, match="--allow-host"):
        open_server(host, 0)
    assert main(["gui", "--host", host, "--port", "0", "--no-open", "--data-dir", str(tmp_path / "data")]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "--allow-host NAME" in told
    assert not (tmp_path / "data").exists(), "before anything is begun"


@pytest.mark.parametrize("name", ["", "*", "http://rig", "rig:8080", "a b", "rig/", "-x;", "a;b", "é", "x" * 300])
def test_a_name_that_is_none_is_refused(name):
    with pytest.raises(InputError, match="--allow-host") as told:
        Door("0.0.0.0", [name])
    assert "\n" not in str(told.value)


def test_a_page_from_elsewhere_is_told_that_the_viewer_is_not_for_it(tmp_path):
    app = App("127.0.0.1", 0, tmp_path, allow_hosts=["rig.example.org"])
    port, token = app.server.get_port(), app.door.token
    try:
        with (
            RawPage(port, host="rig.example.org", token=token) as there,
            RawPage(port, host="localhost", token=token) as here,
        ):
            assert there.drawn.wait(20.0) and here.drawn.wait(20.0)
            wait_until(lambda: there.told() and len(app.server.get_clients()) == 2, 20.0)
            assert [told for told in there.told() if "machine that runs emaviz" in told]
            assert not [told for told in here.told() if "machine that runs emaviz" in told]
    finally:
        app.close()
