"""The whole app under messages that no browser sends: it lives, its values stay, and whoever comes next gets a page."""

from __future__ import annotations

import math
import random
import threading
import time
from collections import Counter

import pytest
import viser
from support.on_page import field, wait_until
from support.raw_page import CAMERA, RawPage

from ema_model.recordings import write_measurement
from emaviz.server import access
from emaviz.server.access import MOST_INT, TYPING_S, checked
from emaviz.server.viser_private import Inside

NUMBERS = (viser.GuiNumberHandle, viser.GuiSliderHandle)
PUSHED = (viser.GuiButtonHandle, viser.GuiButtonGroupHandle, viser.GuiUploadButtonHandle)
FAR = [1e300, -1e300, 1e20, -1e20, 2**64 - 1, -(2**63), float(2**53)]
WRONG = [math.nan, math.inf, -math.inf, "9" * 3000, "1", None, [1], [1, 2], {"a": 1}, b"1", True, [[]], [math.nan] * 3]
TYPES = ["ViewerCameraMessage", "ScenePointerMessage", "ShareUrlRequest", "GuiFormDirtyMessage", "Nonsense", None, 7]


@pytest.fixture(scope="module")
def controls(app):
    """Every control of the page, by its id."""
    assert app.session.ready.wait(120.0)
    app.strip.play(False)
    return dict(app.server.gui._gui_input_handle_from_uuid)


@pytest.fixture(scope="module")
def marker(app, controls):
    """A number that is none of the app's."""
    return app.server.gui.add_number("heard", 0)


@pytest.fixture
def raw(app, marker):
    with RawPage(app.server.get_port()) as page:
        assert page.drawn.wait(20.0)
        page.said.clear()
        yield page


def heard(raw, marker):
    """Returns when the server has dealt with all that this page sent."""
    number = marker.value + 1
    raw.update(marker._impl.uuid, number)
    wait_until(lambda: marker.value == number, 60.0)


def takes(control, value):
    """Whether the value lies within a number's own bounds."""
    whole = type(control.value) is int
    low = control.min if control.min is not None else -MOST_INT if whole else -math.inf
    high = control.max if control.max is not None else MOST_INT if whole else math.inf
    return low <= value <= high


def packable(value):
    """Whether viser can tell the value to a page that comes later."""
    if isinstance(value, (tuple, list)):
        return all(packable(one) for one in value)
    return not isinstance(value, (int, float)) or (
        math.isfinite(value) and (type(value) is float or abs(value) < 2**53)
    )


def stored(controls):
    return {uuid: (one.value, one.update_timestamp) for uuid, one in controls.items()}


def newcomer(app, controls):
    """A page that comes now is drawn completely."""
    with RawPage(app.server.get_port()) as page:
        assert page.drawn.wait(30.0) and not page.closed.is_set()
        shown = {uuid for uuid, one in controls.items() if not one._impl.removed and not isinstance(one, PUSHED)}
        assert shown <= set(page.values)


def test_no_number_control_takes_what_is_not_its_own(app, controls, raw, marker, capfd):
    numbers = {uuid: one for uuid, one in controls.items() if isinstance(one, NUMBERS)}
    assert len(numbers) >= 43
    before = stored(numbers)
    for uuid, control in numbers.items():
        for value in [*WRONG, *(far for far in FAR if not takes(control, far))]:
            raw.update(uuid, value)
    heard(raw, marker)
    assert stored(numbers) == before
    newcomer(app, controls)
    assert "Traceback" not in capfd.readouterr().err


def test_no_other_control_takes_what_is_not_its_own(app, controls, raw, marker, capfd):
    others = {uuid: one for uuid, one in controls.items() if not isinstance(one, NUMBERS)}
    before = stored(others)
    for uuid, control in others.items():
        for value in [*FAR, *WRONG, 0, 0.5, [0.2, 2.0], [0.9, 0.1], "no such option", "x" * 20_000]:
            if value == [1, 2] and isinstance(control, viser.GuiMultiSliderHandle):
                continue  # percent of the picture
            taken = isinstance(value, bool) and isinstance(control, (viser.GuiCheckboxHandle, viser.GuiButtonHandle))
            if taken or (isinstance(control, viser.GuiTextHandle) and isinstance(value, str) and len(value) < 20_000):
                continue
            raw.update(uuid, value)
        for prop in ("update_cb", "props", "sync_cb", "disabled", "options", "max"):
            raw.update(uuid, [], prop)
    heard(raw, marker)
    assert stored(others) == before
    newcomer(app, controls)
    assert "Traceback" not in capfd.readouterr().err


def test_every_refused_number_is_sent_back(controls, raw):
    numbers = {
        uuid: one
        for uuid, one in controls.items()
        if isinstance(one, NUMBERS) and one.visible and not one.disabled and not takes(one, 1e20)
    }
    for uuid in numbers:
        raw.update(uuid, 1e20)
    wait_until(lambda: set(numbers) <= {one.get("uuid") for one in raw.said}, 30.0 + TYPING_S)
    assert all(raw.values[uuid] == one.value for uuid, one in numbers.items())
    assert any(one.startswith("Seed: 1e+20 is above 9007199254740991") for one in raw.told())


# --- presses ----------------------------------------------------------------------------------------------------------


def press_every_button(app, raw, marker):
    """Each once, of every tab; what they ask of the app's threads is done when this returns."""
    buttons = [uuid for uuid, one in app.server.gui._gui_input_handle_from_uuid.items() if one._impl.is_button]
    for uuid in buttons:
        raw.update(uuid, True)
    heard(raw, marker)
    time.sleep(0.5)  # viser's own threads call the handlers
    for _ in range(3):  # what a thread does may ask another
        for thread in (app.screen, app._slow_screen, app._files, app.comparing._files._worker, app.discovering._files):
            done = threading.Event()
            thread.post("pressed", done.set)
            assert done.wait(60.0)
    return len(buttons)


@pytest.fixture
def no_long_runs(app, monkeypatch):
    """As while another long run goes on."""
    monkeypatch.setattr(app.session.worker, "start", lambda *_: False)
    yield
    for job in (app.comparing.job, app.discovering.job):
        job.stop()


@pytest.fixture
def no_gate(monkeypatch):
    """As for a press that was on its way when its control was hidden or disabled."""
    monkeypatch.setattr(Inside, "lets_at", lambda _, control: control is not None)


def test_no_press_of_any_button_before_a_result_costs_a_traceback(
    app, controls, raw, marker, no_long_runs, no_gate, capfd
):
    assert app.discovering.look is None and app.comparing.comparison is None
    kept = {file for file in app.comparing.folder.recordings.iterdir()}
    assert press_every_button(app, raw, marker) > 200
    assert "Traceback" not in capfd.readouterr().err
    assert {file for file in app.comparing.folder.recordings.iterdir()} == kept, "there was nothing to keep"


@pytest.mark.long
def test_no_press_of_any_button_beside_results_costs_a_traceback(app, controls, raw, marker, capfd, request):
    """As before, and with everything computed that the page can show of a challenge and of the sliders' plant."""
    comparing, discovering, identifying = app.comparing, app.discovering, app.session.identifying
    run = app.session.simulation.reference
    write_measurement(run, comparing.folder.uploads / "run.csv")
    comparing.add("uploads/run.csv")
    wait_until(lambda: comparing.comparison is not None and not app.session.worker.busy)
    app.session.settings.set("algorithms", ["do"])
    app.session.settings.set("iterations", 5)
    wait_until(app.session.identify)
    wait_until(lambda: identifying.answer is not None and not app.session.worker.busy)
    discovering.choose("first_bench_run")
    wait_until(discovering.start)
    wait_until(lambda: discovering.look is not None and discovering.look.assessment and not app.session.worker.busy)
    for fixture in ("no_long_runs", "no_gate"):
        request.getfixturevalue(fixture)
    assert press_every_button(app, raw, marker) > 200
    assert "Traceback" not in capfd.readouterr().err


def test_a_picture_that_a_page_does_not_draw_is_no_traceback(app, raw, capfd, monkeypatch):
    monkeypatch.setattr("emaviz.page.charts._LONGEST_S", 0.3)
    for answer in (b"no picture", None):
        raw.update(app.strip._picture._impl.uuid, True)
        wait_until(lambda: raw.asked_for_a_picture, 20.0)
        asked = raw.asked_for_a_picture.pop()
        if answer is not None:
            raw.send({"type": "GetRenderResponseMessage", "payload": answer, "render_uuid": asked})
        wait_until(lambda: any("picture" in one for one in raw.told()), 20.0)
        raw.said.clear()
    assert "Traceback" not in capfd.readouterr().err


# --- at random --------------------------------------------------------------------------------------------------------


def random_value(draw, control):
    """Often what a browser could never send, sometimes what the control takes."""
    if draw.random() < 0.75:
        return draw.choice(
            [*FAR, *WRONG, draw.uniform(-1e3, 1e3), draw.randrange(-1000, 1000), "x" * draw.randrange(500)]
        )
    match control:
        case viser.GuiNumberHandle() | viser.GuiSliderHandle():
            low = -100 if control.min is None else control.min
            high = 100 if control.max is None else control.max
            value = draw.uniform(low, high)
            return round(value) if type(control.value) is int else value
        case viser.GuiCheckboxHandle():
            return draw.random() < 0.5
        case viser.GuiDropdownHandle():
            return draw.choice(control.options)
        case viser.GuiMultiSliderHandle():
            return sorted(draw.uniform(control.min, control.max) for _ in control.value)
    return control.value if isinstance(control, viser.GuiTextHandle) else None


def test_a_choice_that_is_taken_away_while_a_page_makes_it_is_not_kept(app, raw, marker, monkeypatch):
    """As when the folder's list is read again on another thread."""
    choice = app.server.gui.add_dropdown("taken away", ("a", "b"))

    def late(control, value):
        taken = checked(control, value)
        if control._impl is choice._impl:
            choice.options = ("c", "d")
        return taken

    monkeypatch.setattr(access, "checked", late)
    raw.update(choice._impl.uuid, "b")
    heard(raw, marker)
    wait_until(lambda: choice.value == "c", 20.0)
    choice.remove()


def random_message(draw, controls):
    """Of a control mostly; else another message, or none at all."""
    kind = draw.random()
    if kind < 0.9:
        uuid = draw.choice(list(controls))
        if draw.random() < 0.03:
            return {"type": "GuiUpdateMessage", "uuid": uuid[:-1], "updates": {"value": draw.choice(FAR)}}
        prop = "value" if draw.random() < 0.95 else draw.choice(["update_cb", "props", "visible", "uuid"])
        return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {prop: random_value(draw, controls[uuid])}}
    if kind < 0.93:
        return draw.randbytes(draw.randrange(200))
    if kind < 0.96:
        return {**CAMERA, draw.choice([*CAMERA]): draw.choice([*FAR, *WRONG])}
    names = ("uuid", "name", "owner", "part_index", "content", "position", "value")
    return {"type": draw.choice(TYPES), **{name: draw.choice([*FAR, *WRONG]) for name in draw.sample(names, 3)}}


def storm(app, controls, clients, each, seed, seconds):
    """Messages from several pages at once; how many of which control and how many of another kind were sent."""
    sent: Counter[str] = Counter()
    end = time.monotonic() + seconds
    counting = threading.Lock()

    def one(number):
        draw, mine = random.Random(seed + number), Counter()
        with RawPage(app.server.get_port()) as page:
            for _ in range(each):
                message = random_message(draw, controls)
                page.send(message)
                mine["control" if isinstance(message, dict) and message["type"] == "GuiUpdateMessage" else "other"] += 1
                if time.monotonic() > end:
                    mine["out of time"] += 1
                    break
            wait_until(lambda: page.drawn.is_set(), 60.0)
            mine["pages that stayed"] += not page.closed.is_set()
        with counting:
            sent.update(mine)

    threads = [threading.Thread(target=one, args=(number,)) for number in range(clients)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sent


def pressed_by_nobody(controls):
    """The controls without buttons: what a button does to the disk is not what is asked here."""
    return {uuid: one for uuid, one in controls.items() if not isinstance(one, viser.GuiButtonHandle)}


def lives(app, controls, raw, marker):
    """Every value can be told, the model runs, the settings hold, and a new page is drawn."""
    heard(raw, marker)
    assert all(packable(one.value) for one in controls.values() if not isinstance(one, PUSHED))
    for control in controls.values():
        if isinstance(control, NUMBERS):
            assert takes(control, control.value), control.label
        elif isinstance(control, viser.GuiDropdownHandle):
            assert control.value in control.options, control.label
    app.session.settings.restore(app.session.settings.saved())  # which refuses what does not hold
    before = app.session.simulation
    app.session.refresh()
    wait_until(lambda: app.session.simulation is not before, 120.0)
    newcomer(app, controls)


def test_a_few_hundred_random_messages(app, controls, raw, marker, capfd):
    sent = storm(app, pressed_by_nobody(controls), clients=3, each=150, seed=1, seconds=60.0)
    assert sent["pages that stayed"] == 3 and sent["control"] > 300
    lives(app, controls, raw, marker)
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.study
def test_ten_thousand_random_messages_from_five_pages_and_as_many_handshakes(app, controls, raw, marker, capfd):
    sent = storm(app, controls, clients=5, each=2500, seed=100, seconds=240.0)
    handshakes = 0
    for _ in range(60):
        with RawPage(app.server.get_port(), camera=False) as page:
            handshakes += page.drawn.wait(30.0)
    assert sent["control"] >= 10_000 and sent["pages that stayed"] == 5 and handshakes == 60
    app.session.identifying.job.stop()
    lives(app, controls, raw, marker)
    error = capfd.readouterr().err
    with capfd.disabled():
        print(f"\n{dict(sent)}, {handshakes} handshakes, {error.count(chr(10))} lines on stderr")
    assert "Traceback" not in error


# --- in a browser -----------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.browser
def test_a_long_number_is_typed_and_the_page_lives(page, app, controls):
    seed = next(one for one in controls.values() if getattr(one, "label", "") == "Seed")
    page.get_by_role("tab", name="Identify", exact=True).click()
    box = field(page, "Seed")
    box.fill("100000000000000000000")
    box.press("Tab")
    page.get_by_text("Seed: 1e+20 is above 9007199254740991").wait_for(timeout=30_000)
    wait_until(lambda: box.input_value() == str(seed.value), 30.0)
    assert seed.value <= MOST_INT
    newcomer(app, controls)
    # The field may be drawn anew at this moment, as what was refused is sent back; nobody types so soon.
    wait_until(lambda: box.fill("42") or box.input_value() == "42", 30.0)
    box.press("Tab")
    wait_until(lambda: seed.value == 42 and app.session.settings.seed == 42, 30.0)
    slow = field(page, "Population")
    slow.click()
    slow.press("Control+a")
    slow.press_sequentially("120", delay=150)  # 1 and 12 … are below what it takes on the way
    slow.press("Tab")
    wait_until(lambda: app.session.settings.population == 120, 30.0)
    assert slow.input_value() == "120"
