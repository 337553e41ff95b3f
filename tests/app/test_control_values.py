"""No value reaches viser's store that its control does not take; what is refused is sent back.  What a control sets."""

from __future__ import annotations

import math
import threading
from itertools import count
from types import SimpleNamespace

import pytest
import viser
from support.on_page import wait_until
from support.raw_page import RawPage

from ema_model.errors import InputError
from emaviz.page.workspaces import Page
from emaviz.server.access import LONGEST_TEXT, MOST_INT
from emaviz.server.safe_server import open_server
from emaviz.session.jobs import Job, Worker

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


# --- what a control sets in the session -------------------------------------------------------------------------------


@pytest.fixture
def screen():
    worker = Worker("test-screen", lambda error: pytest.fail(repr(error)))
    yield worker
    worker.close()


@pytest.fixture
def page(server, screen):
    return Page(server, None, screen, None, None)


@pytest.fixture
def held(screen):
    """The screen's thread is kept from its work until this is called."""
    go = threading.Event()
    screen.post("held", lambda: go.wait(10.0))
    yield go.set
    go.set()


@pytest.fixture
def session():
    """Takes what is short, and remembers on which threads."""
    session = SimpleNamespace(value="a", taken=[], threads=set())

    def take(value):
        session.threads.add(threading.current_thread().name)
        if len(str(value)) > 1:
            raise InputError("it is too long")
        session.taken.append(value)
        session.value = value

    session.take = take
    return session


def test_a_bound_control_sets_what_a_person_chooses(server, controls, raw, page, session):
    choice = server.gui.add_dropdown("bound", ("a", "b", "long"))
    bound = page.bind(choice, lambda: session.value, session.take)
    raw.update(uuid(choice), "b")
    wait_until(lambda: session.taken == ["b"], 10.0)
    assert session.threads == {"test-screen"}
    session.value = "a"
    bound.show()
    heard(raw, controls)
    assert choice.value == "a" and session.taken == ["b"], "the program's own value is not taken"


def test_a_refused_choice_is_taken_back_and_a_refused_text_stays(server, controls, raw, page, session):
    choice, text = server.gui.add_dropdown("chosen", ("a", "b", "long")), server.gui.add_text("typed", "a")
    for control in (choice, text):
        page.bind(control, lambda: session.value, session.take)
    raw.update(uuid(choice), "long")
    wait_until(lambda: raw.values.get(uuid(choice)) == "a" and choice.value == "a", 10.0)
    raw.update(uuid(text), "long")
    wait_until(lambda: page._refused == {uuid(choice), uuid(text)}, 10.0)
    assert text.value == "long" and not session.taken
    raw.update(uuid(choice), "b")
    raw.update(uuid(text), "c")
    wait_until(lambda: session.taken == ["b", "c"], 10.0)
    assert not page._refused, "what was said goes with the next value"


def test_the_latest_change_counts(server, controls, raw, page, session, held):
    text, choice = server.gui.add_text("later", ""), server.gui.add_dropdown("later too", ("a", "b", "c"))
    page.bind(text, lambda: session.value, session.take)
    chosen = []
    page.changed_to(choice, chosen.append)
    for value in ("b", "c"):
        raw.update(uuid(text), value)
        raw.update(uuid(choice), value)
    heard(raw, controls)
    choice.value = "a"  # the program's: the person's is taken all the same
    held()
    wait_until(lambda: session.taken and chosen, 10.0)
    assert (session.taken, chosen) == (["c"], ["c"])


def test_at_once_waits_for_nothing_that_is_drawn(server, raw, page, session, held):
    slider = server.gui.add_slider("dragged", 0, 9, 1, 0)
    page.bind(slider, lambda: session.value, session.take, at_once=True)
    raw.update(uuid(slider), 7)
    wait_until(lambda: session.taken == [7], 10.0)


def test_a_press_is_answered_on_its_thread_with_its_window(server, raw, page, session):
    button, other = server.gui.add_button("pressed"), server.gui.add_button("pressed by")
    slow, windows = Worker("test-slow", lambda error: pytest.fail(repr(error))), []
    page.pressed(button, lambda: session.take("long"), on=slow)
    page.pressed_by(other, windows.append)
    raw.update(uuid(button), True)
    raw.update(uuid(other), True)
    wait_until(lambda: windows and page._refused == {uuid(button)}, 10.0)
    assert session.threads == {"test-slow"} and windows[0] in server.get_clients().values()
    slow.close()


def test_controls_are_disabled_while_a_job_runs(server, page, screen):
    box, go = server.gui.add_checkbox("waits", False), threading.Event()
    job = Job(screen)
    page.disable_while(job, box)

    def work(_):
        while not go.is_set():
            yield

    assert job.begin("Working", work)
    wait_until(lambda: box.disabled, 10.0)
    go.set()
    wait_until(lambda: not box.disabled and not job.running, 10.0)
