"""No value reaches viser's store that its control does not take; what is refused is sent back."""

from __future__ import annotations

import math
from itertools import count

import pytest
import viser
from support.on_page import wait_until
from support.raw_page import RawPage

from emaviz.server.access import LONGEST_TEXT, MOST_INT
from emaviz.server.safe_server import open_server

# Refused by every control.  3000 digits come as text or as an extension: msgpack's own integers end at 2⁶⁴.
NEVER = [
    math.nan,
    math.inf,
    -math.inf,
    None,
    "9" * 3000,
    {"a": 1},
    [],
    [[1.0, 2.0]],
    [math.nan, math.nan],
    [0.1, math.inf, 0.2],
    b"\x00\xff",
    viser.__version__.encode() * 1000,
    ["a", "b"],
]
# By control: values that it takes, as (sent, stored), and others that it does not.
KINDS = {
    "slider": ([(0.5, 0.5), (1, 1.0)], [1.5, -0.1, 1e300, -1e300, 10**18, "0.5", True, [0.5]]),
    "whole slider": ([(7, 7), (9.0, 9)], [11, -1, 2.5, 1e300, 1e20, 2**63, False]),
    "a third": ([(0.3333333, 1 / 3), (0.6666667, 2 / 3)], [0.667, 0.333]),
    "number": ([(0.25, 0.25), (5, 5.0)], [99.0, -2e9, 1e300, "1", True]),
    "seed": ([(3, 3), (MOST_INT, MOST_INT)], [1e20, 10**17, MOST_INT + 1, 2**64 - 1, -1, 0.5, 1e300, "3"]),
    "free": ([(1e300, 1e300), (-4, -4.0)], ["1e300", True]),
    "range": (
        [([0.2, 0.8], (0.2, 0.8)), ([0, 1], (0.0, 1.0))],
        [[0.8, 0.2], [0.1], [0.1, 1.1], [-1e300, 1], 0.3, "ab"],
    ),
    "checkbox": ([(True, True), (False, False)], [0, 1, "True", 1e300, [True]]),
    "text": ([("x·ω", "x·ω"), ("", "")], ["x" * (LONGEST_TEXT + 1), 1, True, 1e300, ["a"]]),
    "dropdown": ([("b", "b")], ["c", "", 0, 1e300, True, ["a"]]),
    "vector2": ([([0.5, -1], (0.5, -1.0))], [[2, 0], [0, -1e300], [0, 0, 0], [True, False], "ab", 1]),
    "vector3": ([([1, 2, 3e9], (1.0, 2.0, 3e9))], [[1, 2], [1, 2, None], {"0": 1}, 5]),
    "rgb": ([([1, 2, 255], (1, 2, 255))], [[256, 0, 0], [-1, 0, 0], [0.5, 0, 0], [1, 2], [1, 2, 3, 4]]),
    "rgba": ([([1, 2, 3, 4], (1, 2, 3, 4))], [[1, 2, 3], [0, 0, 0, 1e300]]),
    "group": ([("right", "right")], ["up", 0, True, ["left"]]),
    "button": ([(True, True)], [False, 1, "True", 1e300, [True]]),
    "upload": ([], [True, "file", 1e300, {"name": "x", "content": b""}]),
    "progress": ([], [50, 1e300, "x"]),
}


@pytest.fixture(scope="module")
def server():
    server = open_server("127.0.0.1", 0)
    yield server
    server.stop()


@pytest.fixture(scope="module")
def controls(server):
    """One of every kind."""
    gui = server.gui
    return {
        "slider": gui.add_slider("slider", 0.0, 1.0, 0.1, 0.1),
        "whole slider": gui.add_slider("whole slider", 0, 10, 1, 4),
        "a third": gui.add_slider("a third", 1 / 3, 2 / 3, 1e-3, 0.5),
        "number": gui.add_number("number", 6.0, min=-1e9, max=50.0),
        "seed": gui.add_number("seed", 0, min=0, step=1),
        "free": gui.add_number("free", 1.0),
        "range": gui.add_multi_slider("range", 0.0, 1.0, 0.1, (0.1, 0.9)),
        "checkbox": gui.add_checkbox("checkbox", False),
        "text": gui.add_text("text", "as it was"),
        "dropdown": gui.add_dropdown("dropdown", ("a", "b")),
        "vector2": gui.add_vector2("vector2", (0.0, 0.0), min=(-1.0, -1.0), max=(1.0, 1.0)),
        "vector3": gui.add_vector3("vector3", (0.0, 0.0, 0.0)),
        "rgb": gui.add_rgb("rgb", (9, 9, 9)),
        "rgba": gui.add_rgba("rgba", (9, 9, 9, 9)),
        "group": gui.add_button_group("group", ("left", "right")),
        "button": gui.add_button("button"),
        "upload": gui.add_upload_button("upload"),
        "progress": gui.add_progress_bar(10.0),
        "heard": gui.add_number("heard", 0),
    }


@pytest.fixture
def raw(server, controls):
    with RawPage(server.get_port()) as page:
        assert page.drawn.wait(10.0)
        page.said.clear()
        yield page


_numbers = count(1)


def heard(raw, controls):
    """Returns when all that was sent before has been dealt with."""
    number = next(_numbers)
    raw.update(uuid(controls["heard"]), number)
    wait_until(lambda: controls["heard"].value == number, 20.0)


def uuid(control):
    return control._impl.uuid


@pytest.mark.parametrize("kind", KINDS)
def test_a_control_stores_only_what_it_takes(server, controls, raw, kind):
    taken, refused = KINDS[kind]
    control = controls[kind]
    calls = []
    if hasattr(control, "on_update"):
        control.on_update(lambda event: calls.append(event.target.value))
    for sent, stored in taken:
        raw.update(uuid(control), sent)
        heard(raw, controls)
        assert control.value == stored and type(control.value) is type(stored)
    wait_until(lambda: len(calls) == len(taken) or not hasattr(control, "on_update"), 10.0)
    before, stamp = control.value, control.update_timestamp
    for sent in [*refused, *(one for one in NEVER if kind != "text" or not isinstance(one, str))]:
        raw.update(uuid(control), sent)
    heard(raw, controls)
    assert control.value == before and type(control.value) is type(before)
    assert control.update_timestamp == stamp, "nothing happened to it"
    with RawPage(server.get_port()) as other:
        assert other.drawn.wait(10.0), "a page that comes later is drawn"


def test_what_is_refused_is_sent_back(controls, raw):
    box, number = controls["checkbox"], controls["number"]
    raw.update(uuid(box), "on")
    wait_until(lambda: any(one.get("uuid") == uuid(box) for one in raw.said), 10.0)
    assert raw.values[uuid(box)] is box.value
    raw.update(uuid(number), 99)
    wait_until(lambda: any(one.get("uuid") == uuid(number) for one in raw.said), 10.0)
    assert raw.values[uuid(number)] == number.value
    wait_until(lambda: raw.told(), 10.0)
    (told,) = raw.told()
    assert told == "number: 99 is above 50; the value before it stays."


def test_a_number_on_its_way_into_its_bounds_is_left_to_be_typed(controls, raw, monkeypatch):
    monkeypatch.setattr("emaviz.server.access.TYPING_S", 0.3)
    number = controls["number"]
    for typed in (-2e9, -2e10, 60, 6.5):
        raw.update(uuid(number), typed)
    heard(raw, controls)
    wait_until(lambda: number.value == 6.5, 10.0)
    raw.update(uuid(controls["slider"]), 7)  # is sent back later than anything for the number
    wait_until(lambda: any(one.get("uuid") == uuid(controls["slider"]) for one in raw.said), 10.0)
    assert not [one for one in raw.said if one.get("uuid") == uuid(number)]


def test_a_disabled_or_hidden_control_refuses(controls, raw):
    clicked = []
    controls["button"].on_click(lambda _: clicked.append(1))
    for name, value in (("button", True), ("slider", 0.9), ("checkbox", True), ("text", "new")):
        control = controls[name]
        for switch, off in (("disabled", True), ("visible", False)):
            before = control.value
            setattr(control, switch, off)
            raw.update(uuid(control), value)
            heard(raw, controls)
            setattr(control, switch, not off)
            assert control.value == before, (name, switch)
    assert not clicked
    raw.update(uuid(controls["button"]), True)
    wait_until(lambda: clicked, 10.0)


def test_a_control_in_a_hidden_folder_refuses(server, controls, raw):
    gui, clicked = server.gui, []
    with gui.add_folder("outer") as outer:
        tabs = gui.add_tab_group()
        with tabs.add_tab("tab"), gui.add_folder("inner") as inner:
            button, box = gui.add_button("deep"), gui.add_checkbox("deep box", False)
    button.on_click(lambda _: clicked.append(1))
    for hidden in (outer, tabs, inner):
        hidden.visible = False
        raw.update(uuid(button), True)
        raw.update(uuid(box), True)
        heard(raw, controls)
        hidden.visible = True
        assert not box.value
    raw.update(uuid(box), True)
    raw.update(uuid(button), True)
    wait_until(lambda: clicked and box.value, 10.0)
    assert len(clicked) == 1
    outer.remove()
    panel = gui.add_panel()  # which each window shows or hides for itself
    panel.visible = False
    with panel.add_tab("tab"):
        button = gui.add_button("in a panel")
    button.on_click(lambda _: clicked.append(2))
    raw.update(uuid(button), True)
    wait_until(lambda: len(clicked) == 2, 10.0)
    panel.remove()


@pytest.mark.parametrize("prop", ["update_cb", "props", "removed", "uuid", "sync_cb", "is_button", "", 3])
def test_no_other_property_can_be_set(controls, raw, prop):
    control = controls["slider"]
    before, state = control.value, dict(vars(control._impl))
    raw.update(uuid(control), [], prop)
    raw.send({"type": "GuiUpdateMessage", "uuid": uuid(control), "updates": {"value": 0.7, prop: []}})
    raw.send({"type": "GuiUpdateMessage", "uuid": uuid(control), "updates": {}})
    heard(raw, controls)
    assert control.value == before and vars(control._impl) == state


@pytest.mark.parametrize("unknown", ["nobody", "root", "", "x" * 500, None, 3, ["a"]])
def test_an_unknown_control_is_left_out(controls, raw, unknown):
    raw.update(unknown, 1.0)
    heard(raw, controls)
    assert not raw.closed.is_set()


def test_a_control_of_one_page_is_checked_too(server, controls, raw):
    heard(raw, controls)
    client = server.get_clients()[max(server.get_clients())]
    own = client.gui.add_number("own", 3, min=0, max=10)
    for value in (1e20, "4", 11, None):
        raw.update(uuid(own), value)
    heard(raw, controls)
    assert own.value == 3
    raw.update(uuid(own), 4)
    wait_until(lambda: own.value == 4, 10.0)
