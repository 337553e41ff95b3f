"""Everything on the page as one file: round trips, what is refused, reloads, and two tabs in step."""

from __future__ import annotations

import json
import math
import re
import threading
import zipfile

import numpy as np
import pytest
from support.on_page import choose, wait_until

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.faults import HEALTHY
from ema_model.recordings import write_measurement
from ema_model.simulation.run import Run, simulate_reference
from emaviz.figures.identification import Row
from emaviz.page.app import App
from emaviz.page.compare import Asked
from emaviz.page.compare import kept as compare_kept
from emaviz.page.discover import DiscoverTab
from emaviz.page.identify import IdentifyTab
from emaviz.page.playback import Looks, PlaybackStrip
from emaviz.page.runs import RunsTab
from emaviz.page.tab import Shared
from emaviz.page.workspaces import Page, Workspaces
from emaviz.session import session_file
from emaviz.session.compare import Comparing
from emaviz.session.data_folder import DataFolder
from emaviz.session.discovery_source import SavedStory
from emaviz.session.explore import Session
from emaviz.session.session_file import Part, results_part
from emaviz.session.settings import Settings, taken


def changed_settings():
    settings = Settings()
    for index, value in enumerate((0.1, 0.2, 0.3, 0.0, 0.05, 0.4, 0.6, 0.7)):
        settings.set_fault(index, value)
    settings.set("command", "multisine")
    settings.set_command_setting("multisine", "frequencies_Hz", "1+3")
    settings.set_command_setting("chirp", "end_Hz", 20.0)
    settings.set("duration_s", 0.3)
    settings.set("load_torque_Nm", 4.0)
    settings.set("load_shape", "sine")
    settings.set("load_time_s", 0.2)
    settings.set("load_frequency_Hz", 7.0)
    settings.set("current_noise_A", 0.25)
    settings.set("encoder_bits", 12)
    settings.set("start_offset_rad", 0.01)
    settings.set("start_speed_rad_s", 5.0)
    settings.set("start_side", -0.5)
    settings.set_effect("cogging_torque", "amplitude_Nm", 0.012)
    settings.set("monitor", "same faults")
    settings.set("source", "uploads/a.csv")
    settings.set("algorithms", ["do", "robust"])
    settings.set("population", 20)
    settings.set("iterations", 33)
    settings.set("fitness", "raw")
    settings.set("seed", 9)
    return settings


def test_settings_survive_json_and_nothing_is_left_out():
    settings, fresh = changed_settings(), Settings()
    unchanged = [name for name, value in fresh.saved().items() if settings.saved()[name] == value]
    assert not unchanged, "the test changes every setting"
    back = Settings()
    back.restore(json.loads(json.dumps(settings.saved())))
    assert np.array_equal(back.k, settings.k) and back.algorithms == settings.algorithms
    assert back.saved() == settings.saved() and set(back.saved()) == {*Settings.__struct_fields__} - {"axes"}


@pytest.mark.parametrize(
    "damage",
    [
        None,
        [],
        {"k": [1.0] * 9},
        {"k": "abcdefgh"},
        {"k": [math.nan] * 8},
        {"duration_s": 1e9},
        {"command": "../x"},
        {"command_settings": {"nothing": {"a": 1}}},
        {"command_settings": {"chirp": {"colour": 1}}},
        {"command_settings": 7},
        {"effects": {"no_such_effect": {"a": 1}}},
        {"algorithms": []},
        {"algorithms": "robust"},
        {"source": 7},
        {"seed": -1},
    ],
)
def test_damaged_settings_are_refused_and_change_nothing(damage):
    settings = changed_settings()
    before = json.dumps(settings.saved())
    with pytest.raises(InputError) as told:
        settings.restore(damage)
    assert "\n" not in str(told.value) and json.dumps(settings.saved()) == before


@pytest.mark.parametrize(
    ("kind", "saved", "line"),
    [
        (
            Asked,
            {"files": "a.csv"},
            "Expected `array`, got `str` - at `$.files`",
        ),
        (Asked, {}, "Object missing required field `files`"),
        (
            Looks,
            {"opacity": "dark"},
            "Expected `float`, got `str` - at `$.opacity`",
        ),
        (
            Looks,
            {"opacity": 2.0},
            "Expected `float` <= 1.0 - at `$.opacity`",
        ),
        (
            list[Row],
            [{"race": "x"}],
            "Expected `int`, got `str` - at `$[0].race`",
        ),
        (
            SavedStory,
            {"recipe": {"window_s": [0.0, math.inf]}},
            "a window has",
        ),
        (SavedStory, {"recipe": {}, "number": -1}, "Expected `int` >= 0"),
    ],
)
def test_what_a_part_of_a_session_lacks_is_said_in_one_line_with_its_place(kind, saved, line):
    with pytest.raises(InputError) as told:
        taken(kind, saved, "part")
    said = str(told.value)
    assert said.startswith(f"the session's part is damaged ({line}") and said.endswith("); save it anew")


@pytest.fixture
def folder(tmp_path):
    return DataFolder(tmp_path / "data")


def test_a_session_carries_its_files_to_another_folder(folder, tmp_path):
    (folder.uploads / "a.csv").write_text("time_s,current_A\n0,1\n")
    (folder.uploads / "a.toml").write_text("# side\n")
    (folder.uploads / "left.csv").write_text("not part of it")
    saved = {"a": Part(lambda: {"x": [1, 2]}, lambda *_: None)}
    path = session_file.free_path(folder, "my session")
    session_file.write_session(path, saved, folder, ["uploads/a.csv", "uploads/gone.csv", "../../etc/passwd"])
    assert path.name == "my session.emaviz"
    with zipfile.ZipFile(path) as archive:
        assert sorted(archive.namelist()) == ["files/uploads/a.csv", "files/uploads/a.toml", "session.json"]

    other = DataFolder(tmp_path / "other")
    (other.uploads / "a.csv").write_text("another file of this name")
    taken = []
    session_file.read_session(path, {"a": Part(dict, lambda said, names: taken.append((said, dict(names))))}, other)
    assert taken == [({"x": [1, 2]}, {"uploads/a.csv": "uploads/a-2.csv"})]
    assert (other.uploads / "a-2.csv").read_text() == (folder.uploads / "a.csv").read_text()
    assert (other.uploads / "a-2.toml").read_text() == "# side\n"
    assert not [path.name for path in other.uploads.iterdir() if path.name.startswith(".")], "no draft, no lock"
    assert (other.uploads / "a.csv").read_text() == "another file of this name"
    session_file.read_session(path, {}, other)
    session_file.read_session(path, {}, folder)
    assert len(list(folder.uploads.glob("*.csv"))) == 2, "what is there already is not kept twice"


# --- a session brings its results as they were ------------------------------------------------------------------------


@pytest.fixture
def two_apps(tmp_path):
    """One that saves and one that loads, in one data folder, without a screen."""
    made = []

    def new():
        data = DataFolder(tmp_path / "data")
        session = Session(load_actuator(), data.recordings)
        made.append((session, Comparing(session, data)))
        return made[-1][1]

    yield new
    for session, comparing in made:
        comparing.close()
        session.close()


def parts_of(comparing):
    return {
        "comparison": compare_kept(comparing, lambda: None),
        "results": results_part(lambda: {"c": comparing.provenance}),
    }


def compared_and_saved(comparing):
    for name, duration_s in (("a", 0.05), ("b", 0.06)):
        run = simulate_reference(Run(command("chirp", {}), duration_s), load_actuator(), HEALTHY)
        write_measurement(run, comparing.folder.uploads / f"{name}.csv")
        comparing.add(f"uploads/{name}.csv")
    wait_until(lambda: len(comparing.opened) == 2)
    comparing.hold_out("uploads/b.csv", True)
    comparing.asking.ask(by_hand=True)
    wait_until(lambda: comparing.finished is not None and not comparing.running)
    path = comparing.folder.sessions / "whole.emaviz"
    session_file.write_session(path, parts_of(comparing), comparing.folder, list(comparing.opened))
    return path


def test_a_session_brings_its_comparison_whole_and_nothing_is_computed_again(two_apps, monkeypatch):
    first = two_apps()
    path = compared_and_saved(first)

    def refuses(*_, **__):
        raise AssertionError("something is computed again")

    monkeypatch.setattr("ema_model.comparison.compare", refuses)
    second, shown = two_apps(), []
    second.events.compared.connect(shown.append)
    session_file.read_session(path, parts_of(second), second.folder)
    found, was = second.comparison, first.comparison
    assert shown == [found] and found is not was and not second.provenance.missing
    assert not second.provenance.line(), "it is not out of date while its recordings are being read"
    assert json.dumps(found.to_dict()) == json.dumps(was.to_dict()) and str(found) == str(was)
    assert [str(one.to_json()) for one in found.figures()] == [str(one.to_json()) for one in was.figures()]
    for own, its in zip((*found.recordings, *found.holdout), (*was.recordings, *was.holdout), strict=True):
        assert own.measurement.samples == its.measurement.samples
        for name in its.measurement:
            np.testing.assert_array_equal(own.measurement[name], its.measurement[name])
    wait_until(lambda: len(second.opened) == 2 and not second.asking.reading)
    assert second.finished is found and not second.provenance.line()
    second.asking.ask(by_hand=False)  # as the page does once the recordings are open
    assert not second.job.waiting and not second.running and second.comparison is found


@pytest.mark.parametrize("damage", ["before", "class", "field", "array", "shape"])
def test_a_comparison_that_cannot_be_shown_is_to_be_computed_again(two_apps, damage):
    """One of an older session, which says of what it was, and one that somebody has changed."""
    first = two_apps()
    path = compared_and_saved(first)
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    document = json.loads(files["session.json"])
    whole = document["results"]["c"]["whole"]
    if damage == "before":
        del document["results"]["c"]["whole"]
    elif damage == "class":
        whole["class"] = "Path"
    elif damage == "field":
        del whole["fields"]["over_floor"]
    elif damage == "array":
        whole["fields"]["over_floor"] = "1"
    else:
        whole["fields"]["recordings"][0]["fields"]["time_s"]["__array__"][1] = [10**12]
    archive_with(path, {**files, "session.json": json.dumps(document)})
    second = two_apps()
    if damage == "shape":
        with pytest.raises(InputError, match="is no session, or damaged"):
            session_file.read_session(path, parts_of(second), second.folder)
        return
    session_file.read_session(path, parts_of(second), second.folder)
    assert second.comparison is None and second.provenance.missing is not None
    assert "whole.emaviz" not in second.provenance.line() and "a.csv" in second.provenance.line()


def archive_with(path, files):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


GOOD = json.dumps({"schema": 1, "files": []})


def test_what_is_no_session_is_refused_in_one_line(folder, tmp_path, monkeypatch):
    path = tmp_path / "x.emaviz"
    path.write_bytes(b"nothing of the kind")
    cases = [(path, "is no session")]
    cases.append((archive_with(tmp_path / "a.emaviz", {"other.json": "{}"}), "is no session"))
    cases.append((archive_with(tmp_path / "b.emaviz", {"session.json": "{"}), "is no session"))
    cases.append((archive_with(tmp_path / "c.emaviz", {"session.json": '{"schema": 99}'}), "another version"))
    cases.append((tmp_path / "none.emaviz", "^none.emaviz: no such file"))
    cut = archive_with(tmp_path / "d.emaviz", {"session.json": GOOD, "files/uploads/a.csv": "x" * 999})
    cut.write_bytes(cut.read_bytes()[:-30])
    cases.append((cut, "is no session"))
    for file, message in cases:
        with pytest.raises(InputError, match=message) as told:
            session_file.read_session(file, {}, folder)
        assert "\n" not in str(told.value)
    monkeypatch.setattr(session_file, "SESSION_BYTES", 1000)
    listing = json.dumps({"schema": 1, "files": ["uploads/a.csv", "uploads/b.csv"]})
    bomb = archive_with(
        tmp_path / "e.emaviz", {"session.json": listing, "files/uploads/a.csv": "0", "files/uploads/b.csv": "0" * 5000}
    )
    with pytest.raises(InputError, match=r"unpacks to over 0\.001 MB, which is the limit"):
        session_file.read_session(bomb, {}, folder)
    assert not [file for file in folder.folder.rglob("*") if file.is_file()], "no half of a session is left"


def test_files_of_a_session_stay_inside_the_data_folder(folder, tmp_path):
    document = json.dumps({"schema": 1, "files": ["../../evil.csv", "/etc/evil.csv", "uploads/evil.exe"]})
    files = {"session.json": document, "files/../../evil.csv": "1", "files//etc/evil.csv": "2"}
    session_file.read_session(archive_with(tmp_path / "a.emaviz", files), {}, folder)
    outside = [p for p in tmp_path.rglob("*evil*") if not p.is_relative_to(folder.folder)]
    assert not outside and {p.parent.name for p in folder.folder.rglob("*evil*")} == {"uploads"}
    files["files/uploads/evil.exe"] = "3"
    with pytest.raises(InputError, match="evil"):
        session_file.read_session(archive_with(tmp_path / "b.emaviz", files), {}, folder)


# --- in the browser ---------------------------------------------------------------------------------------------------


@pytest.fixture
def page(shared_page):
    """The module's one tab."""
    return shared_page


def slider(page, label):
    found = page.locator("label", has_text=label).first
    row = found.locator("xpath=ancestor::div[contains(@class,'mantine-Flex-root')][1]")
    return row.locator("input:not([type=hidden])").first


@pytest.mark.long
@pytest.mark.browser
def test_two_tabs_stay_in_step_and_a_reload_keeps_the_state(page, app, browser):
    other = browser.new_page(viewport={"width": 1400, "height": 900})
    other.goto(app.address)
    other.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
    box = slider(page, "k1")
    box.fill("0.35")
    box.press("Enter")
    wait_until(lambda: app.session.settings.k[0] == 0.35)
    wait_until(lambda: float(slider(other, "k1").input_value()) == 0.35)
    other.get_by_label("Load torque [N·m]", exact=True).fill("7")
    other.get_by_label("Load torque [N·m]", exact=True).press("Enter")
    wait_until(lambda: page.get_by_label("Load torque [N·m]", exact=True).input_value() == "7")
    other.close()
    page.reload()
    page.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
    wait_until(lambda: float(slider(page, "k1").input_value()) == 0.35)
    assert page.get_by_label("Load torque [N·m]", exact=True).input_value() == "7"
    assert app.session.settings.load_torque_Nm == 7.0


@pytest.mark.browser
def test_what_is_out_of_date_is_marked_and_what_a_session_lacks_is_named_in_its_place(page, app, monkeypatch):
    comparing = app.comparing
    run = simulate_reference(Run(command("chirp", {}), 0.02), load_actuator(), HEALTHY)
    comparing.calibrate = False
    for name in ("a", "b"):
        write_measurement(run, comparing.folder.uploads / f"{name}.csv")
        comparing.add(f"uploads/{name}.csv")
    wait_until(lambda: len(comparing.opened) == 2)
    wait_until(lambda: comparing.provenance.of is not None and not comparing.provenance.line())
    page.get_by_role("tab", name="Compare", exact=True).click()
    page.get_by_role("button", name="Remove", exact=True).click()
    banner = page.get_by_role("status").filter(has_text="was removed since; press Compare.")
    banner.wait_for()
    assert "Out of date: b.csv" in banner.inner_text() or "Out of date: a.csv" in banner.inner_text()
    grey = "one => getComputedStyle(one.closest('.emaviz-out-of-date').parentElement.nextElementSibling).opacity"
    assert float(banner.evaluate(grey)) < 0.9, "the result is greyed"
    banner.get_by_role("button", name="Compute again").click()  # presses the tab's own
    banner.wait_for(state="hidden")
    wait_until(lambda: comparing.comparison is not None and len(comparing.comparison.recordings) == 1)
    wait_until(lambda: not comparing.running)

    identifying = app.session.identifying.provenance
    identifying.take()
    session_file.write_session(
        comparing.folder.sessions / "lacking.emaviz", app.shared.kept(), comparing.folder, list(comparing.opened)
    )
    identifying.clear()
    monkeypatch.setattr(app.session.worker, "start", lambda *_: False)  # what begins by itself has to wait
    page.get_by_role("tab", name="Runs", exact=True).click()
    app.shared.tab(RunsTab).sessions.uploaded(comparing.folder.sessions / "lacking.emaviz")
    page.get_by_text("lacking.emaviz is loaded:").wait_for()
    said = page.locator("div", has_text="lacking.emaviz is loaded:").last.locator("xpath=..").inner_text()
    assert "Identify. To be computed again: the answer of the sliders' plant" in said and "press Identify." in said
    assert "Compare." not in said and "Discover" not in said, "the comparison itself is there"
    page.get_by_role("tab", name="Identify", exact=True).click()
    page.get_by_role("status").filter(has_text="press Identify.").first.wait_for()
    wait_until(lambda: comparing.finished is not None and not comparing.asking.reading)
    page.get_by_role("tab", name="Compare", exact=True).click()
    page.get_by_role("button", name="Remove", exact=True).wait_for()
    assert not page.get_by_role("status").filter(has_text="press Compare.").is_visible()
    comparing.calibrate = True
    identifying.clear()


@pytest.mark.long
@pytest.mark.browser
def test_a_session_is_saved_and_loaded_with_all_that_is_on_the_page(page, app, tmp_path):
    run = simulate_reference(Run(command("chirp", {}), 0.2), load_actuator(), HEALTHY)
    write_measurement(run, app.comparing.folder.uploads / "bench.csv")
    settings = app.session.settings
    app.comparing.add("uploads/bench.csv")
    wait_until(lambda: "uploads/bench.csv" in app.comparing.opened)
    saved = changed_settings().saved() | {"source": "uploads/bench.csv", "fitness": "filtered"}
    settings.restore(saved)
    app.comparing.calibrate = False
    page.get_by_role("tab", name="Runs").click()
    slider(page, "Session name").fill("mine")
    page.wait_for_timeout(300)
    with page.expect_download() as download:
        page.get_by_role("button", name="Save session").click()
    copy = tmp_path / "copy.emaviz"
    download.value.save_as(copy)
    kept = app.comparing.folder.sessions / "mine.emaviz"
    wait_until(kept.is_file)
    assert kept.read_bytes() == copy.read_bytes()

    (app.comparing.folder.sessions / "damaged.emaviz").write_text("no session")  # comes beside, and is listed
    page.get_by_role("tab", name="Explore", exact=True).click()
    page.get_by_role("tab", name="Runs", exact=True).click()
    assert page.get_by_label("Saved", exact=True).input_value() == "sessions/mine.emaviz"
    choose(page, "Saved", "sessions/damaged.emaviz")
    page.get_by_role("button", name="Load session").click()
    refused = page.locator(".emaviz-beside", has_text="damaged.emaviz: is no session")
    refused.wait_for()
    panel = page.locator("[data-dock-region=left] .mantine-ScrollArea-viewport").locator("visible=true").first
    seen, shown = refused.bounding_box(), panel.bounding_box()
    assert seen["y"] + seen["height"] <= shown["y"] + shown["height"] + 1, "it is in sight"
    choose(page, "Saved", "sessions/mine.emaviz")

    settings.restore(Settings().saved())
    app.comparing.calibrate = True
    app.comparing.remove("uploads/bench.csv")
    page.get_by_role("button", name="Load session").click()
    wait_until(lambda: settings.saved() == saved)
    wait_until(lambda: "uploads/bench.csv" in app.comparing.opened and not app.comparing.calibrate)
    page.get_by_role("tab", name="Explore").click()
    wait_until(lambda: float(slider(page, "k6").input_value()) == 0.4)
    wait_until(lambda: page.get_by_label("Duration [s]", exact=True).input_value() == "0.3")
    assert page.get_by_label("Command", exact=True).input_value() == "Multisine"
    page.get_by_role("tab", name="Identify").click()
    assert page.get_by_label("Iterations", exact=True).input_value() == "33"
    assert page.get_by_label("Dandelion", exact=True).is_checked()
    assert not page.get_by_label("Honey Badger", exact=True).is_checked()
    assert page.get_by_label("Identify", exact=True).input_value() == "uploads/bench.csv"
    settings.restore(Settings().saved())


def with_arrays(folder, name, saved):
    """What is in the zip of a session, and what is read from it."""
    back, path = [], session_file.free_path(folder, name)
    session_file.write_session(path, {"a": Part(lambda: saved, lambda *_: None)}, folder, [])
    session_file.read_session(path, {"a": Part(dict, lambda given, _: back.append(given))}, folder)
    with zipfile.ZipFile(path) as archive:
        return {one: archive.read(one) for one in archive.namelist()}, back[0]


def test_each_array_is_in_a_session_once_and_comes_back_in_all_places(folder):
    one = np.arange(1000.0)
    saved = {"a": one, "b": [one.copy(), one[::2]], "c": np.zeros((0, 3)), "d": np.array([True, False]), "e": 7}
    files, back = with_arrays(folder, "once", saved)
    assert len(files["arrays.bin"]) == 8000 + 4000 + 2
    assert np.array_equal(back["a"], one) and back["a"] is back["b"][0] and np.array_equal(back["b"][1], one[::2])
    assert back["c"].shape == (0, 3) and back["d"].dtype == bool and back["e"] == 7


def test_arrays_that_are_more_than_a_session_holds_are_refused(folder, tmp_path, monkeypatch):
    """A small file whose notes ask for the same bytes again and again, each time in another shape."""
    files, _ = with_arrays(folder, "bomb", {"a": np.arange(1000.0)})
    document = json.loads(files["session.json"])
    document["a"] = [{"__array__": ["<f8", [1000 - i], 0]} for i in range(100)]
    archive_with(tmp_path / "bomb.emaviz", {**files, "session.json": json.dumps(document)})
    monkeypatch.setattr(session_file, "SESSION_BYTES", 100_000)
    with pytest.raises(InputError, match="its arrays do not fit"):
        session_file.read_session(tmp_path / "bomb.emaviz", {}, folder)
    with pytest.raises(InputError, match="too large to be opened again"):
        with_arrays(folder, "large", {"a": np.arange(20_000.0)})
    assert folder.session_files() == ["sessions/bomb.emaviz"], "nothing is left behind"


# --- a whole page, in an app that has computed nothing ----------------------------------------------------------------


def drawn(tab):
    """What a tab shows, by where its code has it: texts, figures, choices."""
    found, seen = {}, set()

    def walk(of, path):
        if id(of) in seen or isinstance(of, Page | Shared | PlaybackStrip | App):
            return
        seen.add(id(of))
        if isinstance(of, dict):
            parts = of.items()
        elif isinstance(of, list | tuple):
            parts = enumerate(of)
        elif type(of).__module__.startswith("viser."):
            impl = getattr(of, "_impl", None)
            props = {} if impl is None else {name: getattr(impl.props, name, None) for name in SHOWN}
            found[path] = {**props, "value": getattr(impl, "value", None)}
            return
        elif type(of).__module__.startswith(("emaviz.page.", "emaviz.figures.")) and hasattr(of, "__dict__"):
            parts = vars(of).items()
        else:
            return
        for name, part in parts:
            walk(part, f"{path}.{name}")

    walk(tab.panel, "panel")
    walk(tab.result, "result")
    ids = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}")
    return {
        path: json.loads(ids.sub("", json.dumps(one, default=lambda at: np.asarray(at).tolist())))
        for path, one in found.items()
    }


SHOWN = ("content", "visible", "label", "_plotly_json_str", "data", "options", "disabled")


def at_rest(app):
    """Everything that was asked is computed and drawn."""
    wait_until(lambda: not (app.discovering.running or app.session.worker.busy), 240.0)
    for _ in range(2):
        for worker in (app.screen, app._slow_screen, app._files):
            done = threading.Event()
            worker.post("at rest", done.set)
            assert done.wait(60.0)


@pytest.fixture
def apps(tmp_path, monkeypatch):
    """Two apps that draw all tabs, as if each was looked at."""
    monkeypatch.setattr(Workspaces, "anyone", lambda self, name: True)
    made = [App("127.0.0.1", 0, tmp_path / name) for name in ("here", "there")]
    for one in made:
        assert one.wait_for_first_picture(120.0)
    yield made
    for one in made:
        one.close()


@pytest.mark.long
def test_a_whole_session_is_drawn_as_it_was_by_an_app_that_computes_nothing(apps, computed):
    here, there = apps
    discovering, session = here.discovering, here.session
    discovering.choose("first_bench_run")
    for begin in (discovering.start, lambda: discovering.add("cogging_torque")):
        assert begin()
        wait_until(lambda: not discovering.running, 240.0)
    session.settings.set_fault(2, 0.3)
    for name, value in (("algorithms", ["do", "robust"]), ("population", 12), ("iterations", 6)):
        session.settings.set(name, value)
    here.screen.post("settings", lambda: [tab.show_settings() for tab in here.shared.tabs.values()])
    assert session.identify()
    wait_until(lambda: session.identifying.race is not None and not session.identifying.job.running, 120.0)
    at_rest(here)
    here.tab(RunsTab).sessions._save(None)
    (name,) = here.comparing.folder.session_files()
    path = here.comparing.folder.session(name)

    told, begun = [], []
    there.session.events.told.connect(lambda *line: told.append(line))
    for job in (there.discovering.job, there.session.identifying.job, there.comparing.job):
        job.began.connect(begun.append)
    at_rest(there)
    computed.clear()
    there.screen.post("load", lambda: there.tab(RunsTab).sessions._read(path))
    at_rest(there)
    assert not begun and not told and not there.standings.lines()
    assert {*computed} <= {"find_stack"}, "Explore's own plant is shown with the session's faults"

    for kind, of_this_run in (
        (DiscoverTab, ("panel._line", "panel._result._left")),  # what ran here; the plot of a folder that is not shown
        (
            IdentifyTab,
            ("panel._line", "panel._link", "panel._watch", "panel._result._empty"),
        ),  # likewise; its recording
    ):
        before, after = drawn(here.tab(kind)), drawn(there.tab(kind))
        assert before.keys() == after.keys() and len(before) > 20
        other = [path for path in before if before[path] != after[path] and not path.startswith(of_this_run)]
        assert not other, [(path, before[path], after[path]) for path in other[:3]]
        assert sum(bool(one.get("_plotly_json_str") or one.get("data")) for one in after.values()) >= 2
