"""The viewer's host: what it serves, what it refuses, and that a browser draws."""

from __future__ import annotations

import gzip
import http.client
import socket
import subprocess
import sys

import pytest

from ema_model.files.written import FileLock, lock_path
from emaviz.recording import RecordingError, RecordingWriter
from emaviz.recording.viewer import ViewerHost, view


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    (folder / "a b.rrd").write_bytes(b"RRF2 content")
    (folder / "notes.txt").write_text("secret")
    (folder / "inside").mkdir()
    (folder / "inside" / "c.rrd").write_bytes(b"RRF2")
    outside = folder.parent / "outside.rrd"
    outside.write_bytes(b"RRF2 outside")
    (folder / "link.rrd").symlink_to(outside)
    with ViewerHost(folder) as host:
        yield host


def get(host, path, *, method="GET", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", host.port, timeout=30)
    try:
        connection.request(method, path, headers={k.replace("_", "-"): v for k, v in headers.items()})
        answer = connection.getresponse()
        return answer, answer.read()
    finally:
        connection.close()


def test_the_viewer_is_served_and_may_call_nobody(host):
    page, body = get(host, "/?url=x")
    assert b"fonts." not in body, "a link is a connection that no policy refuses"
    assert body.index(b"window.fetch = ") < body.index(b"re_viewer.js"), "who asks abroad is answered at home"
    assert page.status == 200 and b"re_viewer.js" in body and page.headers["Content-Type"].startswith("text/html")
    policy = page.headers["Content-Security-Policy"]
    assert "connect-src 'self' blob: data: http://127.0.0.1:*;" in policy and "default-src 'self'" in policy
    assert page.headers["X-Content-Type-Options"] == "nosniff"
    script, _ = get(host, "/re_viewer.js")
    assert script.headers["Content-Type"].startswith("text/javascript")


def test_the_program_is_compressed_once_and_kept_by_browsers(host):
    raw, body = get(host, "/re_viewer_bg.wasm")
    assert raw.headers["Content-Type"] == "application/wasm" and body[:4] == b"\0asm" and len(body) > 10**7
    small, packed = get(host, "/re_viewer_bg.wasm", Accept_Encoding="br, gzip")
    assert small.headers["Content-Encoding"] == "gzip" and len(packed) < len(body) / 2
    assert gzip.decompress(packed) == body
    again, nothing = get(host, "/re_viewer_bg.wasm", If_None_Match=raw.headers["ETag"])
    assert again.status == 304 and nothing == b""


def test_recordings_of_the_folder_are_served(host):
    answer, body = get(host, "/recordings/a%20b.rrd")
    assert answer.status == 200 and body == b"RRF2 content"
    assert answer.headers["X-Content-Type-Options"] == "nosniff" and "Access-Control-Allow-Origin" not in answer.headers
    head, nothing = get(host, "/recordings/a%20b.rrd", method="HEAD")
    assert head.headers["Content-Length"] == "12" and nothing == b""
    url = host.url_of("a b.rrd")
    assert url.startswith(
        f"http://127.0.0.1:{host.port}/?url=http%3A%2F%2F127.0.0.1%3A{host.port}%2Frecordings%2Fa%2520b.rrd&"
    )
    assert "hide_welcome_screen=1" in url and "persist=0" in url


@pytest.mark.parametrize(
    "path",
    [
        "/recordings/",
        "/recordings/none.rrd",
        "/recordings/notes.txt",
        "/recordings/link.rrd",
        "/recordings/inside/c.rrd",
        "/recordings/inside%2Fc.rrd",
        "/recordings/../outside.rrd",
        "/recordings/..%2foutside.rrd",
        "/recordings/%2e%2e/outside.rrd",
        "/recordings/..%5Coutside.rrd",
        "/recordings/a%00.rrd",
        "/recordings//etc/passwd",
        "/../../etc/passwd",
        "/sw.js",
    ],
)
def test_nothing_else_is_served(host, path):
    assert get(host, path)[0].status == 404


@pytest.mark.parametrize(
    "name", ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1:1", "localhost.evil:80", ""]
)
def test_other_host_names_are_refused(host, name):
    for path in ("/", "/recordings/a%20b.rrd"):
        answer, body = get(host, path, Host=name)
        assert answer.status == 403 and b"content" not in body


def test_localhost_is_allowed_and_other_methods_are_not(host):
    assert get(host, "/", Host=f"localhost:{host.port}")[0].status == 200
    assert get(host, "/recordings/a%20b.rrd", method="POST")[0].status == 501


def test_one_file_only(tmp_path):
    for name in ("a.rrd", "b.rrd"):
        (tmp_path / name).write_bytes(b"RRF2")
    with ViewerHost(tmp_path, only="a.rrd") as host:
        assert get(host, "/recordings/a.rrd")[0].status == 200
        assert get(host, "/recordings/b.rrd")[0].status == 404


def test_what_a_killed_writer_left_does_not_keep_a_browser_waiting(tmp_path):
    part = tmp_path / "a.rrd.part"
    part.write_bytes(b"RRF2")
    with ViewerHost(tmp_path) as host:
        lock = FileLock.acquire(lock_path(part))
        assert lock is not None and host.find_growing("a.rrd") == part
        lock.release()
        lock_path(part).touch()  # of a process that is gone
        assert host.find_growing("a.rrd") is None
        answer, _ = get(host, "/recordings/a.rrd")
        assert answer.status == 404


def test_a_host_that_cannot_start_says_why(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        with pytest.raises(RecordingError, match="already in use; choose another"):
            ViewerHost(tmp_path, port=taken.getsockname()[1])
    with pytest.raises(RecordingError, match="port 70000"):
        ViewerHost(tmp_path, port=70000)
    with pytest.raises(RecordingError, match="no such folder"):
        ViewerHost(tmp_path / "none")


@pytest.mark.skipif(sys.platform == "win32", reason="sends an interrupt")
def test_view_prints_the_address_and_ends_with_an_interrupt(tmp_path):
    import signal

    with RecordingWriter(tmp_path / "a.rrd"):
        pass
    # Whoever runs the tests in the background has the interrupt ignored, and so would the viewer.
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from emaviz.recording.viewer import view; view(sys.argv[1], open_browser=False)"
    )
    process = subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "a.rrd")], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and "a.rrd: http://127.0.0.1:" in process.stdout.readline()
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 0  # on a loaded machine, too
    process.stdout.close()


def test_view_tells_a_name_that_would_not_be_served(tmp_path):
    (tmp_path / "a.RRD").write_bytes(b"RRF2 content")
    with pytest.raises(RecordingError, match=r"must end in \.rrd, or in \.part"):
        view(tmp_path / "a.RRD", open_browser=False)


@pytest.mark.long
@pytest.mark.browser
def test_a_browser_draws_the_recording(tmp_path, write, browser):
    with RecordingWriter(tmp_path / "a.rrd") as writer:
        write(writer)
    with ViewerHost(tmp_path) as host:
        page = browser.new_page(viewport={"width": 1000, "height": 650}, color_scheme="dark", drawn=True)
        abroad, fetched = [], []
        page.on("requestfinished", lambda r: (fetched if r.url.startswith(host.address) else abroad).append(r.url))
        page.goto(host.url_of("a.rrd"))
        page.wait_for_selector("#the_canvas_id.visible", timeout=60_000)
        for _ in range(40):
            page.wait_for_timeout(500)
            colours = _colours(page.screenshot(path=tmp_path / "viewer.png"))
            if colours["blue"] > 500 and colours["red"] > 500:
                break
        page.close()
    assert colours["blue"] > 500 and colours["red"] > 500  # the reference and the residual
    assert any(url.endswith("/recordings/a.rrd") for url in fetched) and abroad == []


def _colours(picture: bytes) -> dict[str, int]:
    """How many pixels of a screenshot look like the reference's and the residual's lines."""
    import io

    import numpy as np
    from PIL import Image

    red, _, blue = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=int).transpose(2, 0, 1)
    return {"blue": int((blue > red + 60).sum()), "red": int((red > blue + 100).sum())}
