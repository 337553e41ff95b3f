"""What no page sends costs one line on stderr, a flood of it a few; the server goes on."""

from __future__ import annotations

import dataclasses
import random
import socket

import pytest
import viser._messages
from support.on_page import wait_until
from support.raw_page import CAMERA, RawPage
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from emaviz.server import access
from emaviz.server.access import Complaints
from emaviz.server.safe_server import open_server

DEEP = b"\x83\xa4type\xb0GuiUpdateMessage\xa4uuid\xa1x\xa7updates\x81\xa5value" + b"\x91" * 100_000
MALFORMED = [
    *(
        b"",
        b"\xc1",
        b"\x93",
        b"\xdf\xff\xff\xff\xff",
        b"\xa4\xff\xff\xff\xff",
        b"\x91" * 100_000,
        DEEP,
        b"\x00" * 500_000,
    ),
    *("", "text", "x" * 500_000),
    *(None, 3, [], {}, {"type": None}, {"type": ["GuiUpdateMessage"]}, {"type": "Nonsense"}, {1: 2}, {"uuid": "x"}),
    *({"type": "GuiUpdateMessage"}, {"type": "GuiUpdateMessage", "uuid": "x"}, {**CAMERA, "fov": float("nan")}),
    *({**CAMERA, "position": [0, 0, float("inf")]}, {**CAMERA, "wxyz": [1, 0, 0]}, {**CAMERA, "far": 1e300}),
    *({**CAMERA, "image_width": -1}, {**CAMERA, "look_at": None}, {**CAMERA, "more": 1}),
    *({"type": "ShareUrlRequest"}, {"type": "ShareUrlDisconnect"}, {"type": "ResetGuiMessage"}),
    {"type": "RunJavascriptMessage", "source": "alert(1)"},
    {"type": "SceneNodeUpdateMessage", "name": "/WorldAxes", "updates": {"visible": True}},
    {
        "type": "FileTransferPartAck",
        "source_component_uuid": "x",
        "transfer_uuid": "x",
        "transferred_bytes": 1,
        "total_bytes": 1,
    },
]


@pytest.fixture(scope="module")
def server():
    server = open_server("127.0.0.1", 0)
    yield server
    server.stop()


@pytest.fixture
def told(monkeypatch):
    """Every line of complaint, none held back."""
    lines = []
    monkeypatch.setattr(Complaints, "__call__", lambda self, text: lines.append(text))
    return lines


@pytest.mark.parametrize("message", MALFORMED, ids=lambda one: repr(one)[:40])
def test_one_line_and_the_page_stays(server, told, message, capfd):
    with RawPage(server.get_port()) as raw:
        raw.send(message)
        raw.send("the end")
        wait_until(lambda: len(told) >= 2, 10.0)
        assert not raw.closed.is_set()
    assert len(told) == 2, told
    assert "Traceback" not in capfd.readouterr().err


def test_a_huge_frame_ends_its_connection_alone(server, told):
    with RawPage(server.get_port()) as other, RawPage(server.get_port()) as raw:
        raw.send(b"\x00" * (access.LARGEST_FRAME + 1))
        assert raw.closed.wait(10.0)
        wait_until(lambda: told, 10.0)
        assert len(told) == 1 and "exceeds limit" in told[0]
        assert other.drawn.wait(10.0) and not other.closed.is_set()


@pytest.mark.parametrize(
    "bytes_",
    [b"\x16\x03\x01\x02\x00", b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n", b"GET /\r\n\r\n", b"\x00" * 70_000],
)
def test_what_is_no_request_costs_a_line_at_most(server, capfd, bytes_):
    with socket.create_connection(("127.0.0.1", server.get_port()), timeout=10) as plug:
        plug.sendall(bytes_ + b"\r\n\r\n")
        try:
            while plug.recv(4096):
                pass
        except ConnectionError:
            pass
    with RawPage(server.get_port()) as raw:
        assert raw.drawn.wait(10.0)
    error = capfd.readouterr().err
    assert "Traceback" not in error and error.count("\n") <= 1


@pytest.mark.parametrize("protocol", [None, ["viser-v0.0.1"], ["mqtt"]])
def test_another_version_is_turned_away_with_a_line(server, told, protocol, capfd):
    capfd.readouterr()
    with connect(f"ws://127.0.0.1:{server.get_port()}", subprotocols=protocol, proxy=None) as plug:
        with pytest.raises(Exception, match="Version mismatch"):
            plug.recv(10)
    assert len(told) == 1 and not capfd.readouterr().out


def test_a_websocket_of_another_page_is_refused(server):
    with pytest.raises(InvalidStatus, match="403"):
        connect(f"ws://127.0.0.1:{server.get_port()}", origin="http://evil.example", proxy=None)


def test_a_flood_prints_a_few_lines(server, capfd):
    random_, box = random.Random(1), server.gui.add_checkbox("over", False)
    capfd.readouterr()
    with RawPage(server.get_port()) as raw:
        for _ in range(3000):
            raw.send(random_.randbytes(random_.randrange(60)))
        raw.update(box._impl.uuid, True)
        wait_until(lambda: box.value, 20.0)
    error = capfd.readouterr().err
    assert 1 <= error.count("\n") <= 12 and len(error) < 5000 and "Traceback" not in error


def test_what_was_not_printed_is_counted(capfd, monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("emaviz.server.access.time.monotonic", lambda: now[0])
    complain = Complaints()
    for number in range(50):
        complain(f"line\n{number}\x1b[31m" + "x" * 1000)
    assert capfd.readouterr().err.count("\n") == 10
    now[0] += 61.0
    complain("again")
    assert capfd.readouterr().err == "emaviz: again (and 40 more before it)\n"


def test_the_scene_and_forms_know_their_own_only(server, told):
    """Of nodes and forms that do not exist nothing is passed on, nor kept."""
    nowhere = {"name": "/nowhere", "owner": ""}
    ray = {"ray_origin": [0, 0, 0], "ray_direction": [0, 0, 1], "modifier": None}
    with RawPage(server.get_port()) as raw:
        before = len(server._websock_server._broadcast_buffer.message_from_id)
        raw.send({"type": "SceneNodeClickMessage", **nowhere, **ray, "instance_index": None, "screen_pos": [0, 0]})
        raw.send({"type": "TransformControlsUpdateMessage", **nowhere, "wxyz": [1, 0, 0, 0], "position": [0, 0, 0]})
        raw.send({"type": "TransformControlsDragStartMessage", **nowhere})
        for number in range(50):
            raw.send({"type": "GuiFormDirtyMessage", "uuid": f"form {number}"})
            raw.send({"type": "GuiFormSubmitMessage", "uuid": f"form {number}"})
            raw.send({"type": "CommandTriggerMessage", "uuid": f"command {number}"})
            raw.send({"type": "GuiButtonHoldMessage", "uuid": f"button {number}", "frequency": 10.0})
        raw.send("the end")
        wait_until(lambda: told, 10.0)
        assert len(told) == 1, "they are messages of a page"
        assert len(server._websock_server._broadcast_buffer.message_from_id) == before


def test_a_file_needs_a_button_that_takes_one(server, told):
    button = server.gui.add_upload_button("file")
    start = {"type": "FileTransferStartUpload", "filename": "x", "mime_type": "", "part_count": 2, "size_bytes": 9}
    with RawPage(server.get_port()) as raw:
        for number, source in enumerate(("nobody", button._impl.uuid)):
            raw.send({**start, "source_component_uuid": source, "transfer_uuid": f"transfer {number}"})
        for part, size in ((-1, 9), (2**63, 9), (2, -1), (2, 1e300), (None, 9), ("2", 9)):
            source = {"source_component_uuid": button._impl.uuid, "transfer_uuid": "senseless"}
            raw.send({**start, **source, "part_count": part, "size_bytes": size})
        raw.send(
            {
                "type": "FileTransferPart",
                "source_component_uuid": None,
                "transfer_uuid": "x",
                "part_index": 0,
                "content": 3,
            }
        )
        raw.send("the end")
        wait_until(lambda: len(told) == 8, 10.0)
        assert list(server.gui._current_file_upload_states) == ["transfer 1"]
        button.disabled = True
        raw.send({**start, "source_component_uuid": button._impl.uuid, "transfer_uuid": "disabled"})
        raw.send("the end")
        wait_until(lambda: len(told) == 9, 10.0)
        assert list(server.gui._current_file_upload_states) == ["transfer 1"]


def test_every_message_that_viser_listens_to_is_decided_on(server):
    """Each name and field here is viser's; a new viser that listens to something else is noticed."""
    for kind in access.Message.__subclasses__():
        theirs = dataclasses.fields(getattr(viser._messages, kind.__name__))
        assert [field.name for field in theirs if field.init] == list(kind.__struct_fields__), kind
    heard = {kind.__name__ for kind in server._websock_server._incoming_handlers}
    known = {kind.__name__ for kind in access.Message.__subclasses__()}
    assert heard - known == {"ShareUrlRequest", "ShareUrlDisconnect"}
    assert known - heard == {  # which viser listens to on a page's own connection, the answers after its questions
        "ViewerCameraMessage",
        "LocalStorageGetItemResponseMessage",
        "GetRenderResponseMessage",
    }
