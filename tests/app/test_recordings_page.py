"""Past recordings: listed with their results, renamed, deleted, compared, shown live; without a browser and in one."""

from __future__ import annotations

import http.client
import os
import threading
from urllib.parse import quote

import numpy as np
import pytest
from support.on_page import field, wait_until

from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from ema_model.text import COLOURS
from emaviz.figures import runs
from emaviz.recording import RecordingWriter, read
from emaviz.recording.entry import setting
from emaviz.recording.viewer import ViewerHost
from emaviz.session.explore import Session
from emaviz.session.files import RecordedRuns


def identify(session, seconds=60.0):
    """Runs one to its end; its recording's path."""
    done, races = threading.Event(), []

    def keep(race):
        races.append(race)
        done.set()

    session.identifying.identified.connect(keep)
    assert session.identify()
    assert done.wait(seconds)
    session.identifying.identified.disconnect(keep)
    wait_until(lambda: not session.worker.busy)
    return races[0]


@pytest.fixture(scope="module")
def races(tmp_path_factory):
    """Two identifications of different faults, recorded in one folder."""
    session = Session(load_actuator(), tmp_path_factory.mktemp("recordings"))
    session.start()
    assert session.ready.wait(120.0)
    session.settings.set("iterations", 12)
    session.settings.set_fault(0, 0.2)
    session.settings.set("algorithms", ["do", "hba"])
    first = identify(session)
    session.settings.set_fault(0, 0.6)
    session.settings.set("algorithms", ["do"])
    second = identify(session)
    yield first, second
    session.close()


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("amplitude_rad", 0.005, ("amplitude", "5.00 mrad")),
        ("noise_A", "0.1", ("noise", "0.100 A")),
        ("iterations", "150", ("iterations", "150")),
        ("algorithms", ["do", "hba"], ("algorithms", "Dandelion, Honey Badger")),
        ("command", "chirp", ("command", "chirp")),
        ("seed", "–", ("seed", "–")),
    ],
)
def test_settings_are_told_in_words_and_units(name, value, told):
    assert setting(name, value) == told


@pytest.fixture
def recorded(races, tmp_path):
    for race in races:
        os.link(race.path, tmp_path / race.path.name)
    return RecordedRuns(tmp_path)


# --- without a browser ------------------------------------------------------------------------------------------------


def test_the_list_has_settings_and_results(recorded, races):
    assert recorded.names() == [races[1].path.name, races[0].path.name]
    entry = recorded.entry(races[0].path.name)
    assert entry.settings["algorithms"] == "do, hba" and entry.settings["iterations"] == 12
    assert entry.settings["k"].startswith("0.2 ")
    assert set(entry.found) == {"do", "hba"} and entry.best == races[0].best.algorithm
    answer = races[0].best.answer
    assert np.allclose(entry.answer["k"], answer.k) and entry.answer["rmse_A"] == pytest.approx(answer.rmse)
    assert entry.answer["error_percent"] == pytest.approx(answer.error_percent)
    assert recorded.entry(races[0].path.name) is entry, "a file that has not changed is not read again"


def test_a_recording_of_something_else_is_listed_without_a_result(recorded, tmp_path):
    with RecordingWriter(tmp_path / "plain.rrd") as writer:
        writer.signals("monitor", [0.0, 1.0], {"current_A": [1.0, 2.0]})
    (tmp_path / "broken.rrd").write_bytes(b"RRF2 and then nonsense")
    (tmp_path / "empty.rrd").write_bytes(b"")
    for name in ("plain.rrd", "broken.rrd", "empty.rrd"):
        entry = recorded.entry(name)
        assert entry.found == {} and entry.answer is None
    assert len(recorded.names()) == 5
    with pytest.raises(InputError):
        recorded.read("empty.rrd")


def test_renaming_keeps_the_content_and_spares_what_exists(recorded, races):
    old, other = races[0].path.name, races[1].path.name
    said = recorded.entry(old).settings
    assert recorded.rename(old, "friction, low") == "friction_ low.rrd"
    assert recorded.entry("friction_ low.rrd").settings == said and old not in recorded.names()
    for wanted in (other, "", "  ", ".rrd"):
        with pytest.raises(InputError) as told:
            recorded.rename("friction_ low.rrd", wanted)
        assert "\n" not in str(told.value)
    assert recorded.rename("friction_ low.rrd", "../../x") == "x.rrd"
    assert sorted(recorded.names()) == sorted(["x.rrd", other])


@pytest.mark.parametrize("name", ["../a.rrd", "/etc/passwd", "none.rrd", "a.csv", "", ".", "a.rrd\0"])
def test_only_listed_names_are_taken(recorded, tmp_path, name):
    (tmp_path / "a.csv").write_text("x")
    (tmp_path.parent / "a.rrd").write_bytes(b"RRF2")
    for act in (recorded.entry, recorded.delete, recorded.read, lambda n: recorded.rename(n, "b")):
        with pytest.raises(InputError) as told:
            act(name)
        assert "\n" not in str(told.value)
    assert (tmp_path / "a.csv").exists() and (tmp_path.parent / "a.rrd").exists()


def test_delete_removes_one(recorded, races):
    recorded.delete(races[0].path.name)
    assert recorded.names() == [races[1].path.name]


def test_two_recordings_share_their_axes(recorded, races):
    names = [race.path.name for race in races]
    first, second = (recorded.read(name) for name in names)
    assert "current_A" in runs.signals(first, second)
    figure = runs.two_recordings(first, second, "current_A")
    drawn = {trace.name: trace for trace in figure.data}
    assert {"A fitted", "B fitted", "A recorded", "B recorded", "A residual", "B residual"} <= set(drawn)
    assert {"A Dandelion", "A Honey Badger", "B Dandelion"} <= set(drawn)
    assert np.allclose(drawn["B Dandelion"].y, second.identification["do"].corrected)
    assert figure.layout.yaxis3.title.text == "Corrected<br>error [A]"
    assert drawn["A fitted"].yaxis == drawn["B fitted"].yaxis
    text = runs.two_recordings_table(*(recorded.entry(name) for name in names))
    assert "0.2 0 0" in text and "0.6 0 0" in text and "population" not in text, "only what differs"
    k1, k7 = (text[text.index(f"<td>{name}") :].split("</tr>")[0] for name in ("k1 friction", "k7"))
    assert COLOURS["warning"] in k1 and COLOURS["warning"] not in k7, (
        "a direction of an eccentricity that is not there does not differ"
    )


def test_an_identification_is_arranged_once(races):
    from rerun.chunk import RrdReader

    assert len(RrdReader(races[0].path).blueprints()) == 1


@pytest.mark.filterwarnings("ignore:RRD file has no footer")  # of one that is still being written
def test_a_recording_is_arranged_before_it_is_whole(tmp_path):
    from rerun.chunk import RrdReader

    writer = RecordingWriter(tmp_path / "a.rrd")
    writer.signals("monitor", [0.0, 1.0], {"current_A": [1.0, 2.0]})
    writer.expect({"monitor": ["current_A"]}, [])
    writer.flush()
    early = tmp_path / "early.rrd"
    early.write_bytes((tmp_path / "a.rrd.part").read_bytes())
    assert len(RrdReader(early).blueprints()) == 1
    writer.signals("residual", [0.0, 1.0], {"current_A": [1.0, 2.0]})  # not expected, so arranged anew
    writer.close()
    assert len(RrdReader(tmp_path / "a.rrd").blueprints()) == 1, "the one that counts, before all that it shows"


def test_a_growing_recording_is_served_as_it_grows(tmp_path):
    with ViewerHost(tmp_path) as host:
        writer = RecordingWriter(tmp_path / "a b.rrd")
        writer.signals("monitor", [0.0, 1.0], {"current_A": [1.0, 2.0]})
        connection = http.client.HTTPConnection("127.0.0.1", host.port, timeout=20)
        connection.request("GET", "/recordings/" + quote("a b.rrd"))
        answer = connection.getresponse()
        assert answer.status == 200 and answer.getheader("Content-Length") is None
        got = answer.read1(4)
        assert got == b"RRF2", "it comes before the writer is done"
        writer.signals("monitor", [2.0, 3.0], {"current_A": [3.0, 4.0]})
        writer.close()
        copy = tmp_path / "copy.rrd"
        copy.write_bytes(got + answer.read())
        connection.close()
        for one in (copy, tmp_path / "a b.rrd"):
            assert list(read(one).signals["monitor"]["current_A"].values) == [1.0, 2.0, 3.0, 4.0]


def test_closing_the_host_ends_what_follows_a_recording(tmp_path):
    host = ViewerHost(tmp_path)
    with RecordingWriter(tmp_path / "a.rrd") as writer:
        writer.signals("monitor", [0.0, 1.0], {"current_A": [1.0, 2.0]})
        connection = http.client.HTTPConnection("127.0.0.1", host.port, timeout=20)
        connection.request("GET", "/recordings/a.rrd")
        answer = connection.getresponse()
        host.close()
        assert answer.read().startswith(b"RRF2")
        connection.close()
    (tmp_path / "b.rrd.part").write_bytes(b"RRF2 left by a process that died")
    with ViewerHost(tmp_path) as other:
        assert other.find_growing("b.rrd") is None


# --- in the browser ---------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.browser
def test_recordings_are_opened_compared_renamed_and_deleted(watched, app):
    page, session = watched, app.session
    session.settings.set("iterations", 8)
    session.settings.set("algorithms", ["do"])
    first = identify(session).path
    session.settings.set_fault(1, 0.5)
    second = identify(session).path
    page.get_by_role("tab", name="Runs").click()
    wait_until(lambda: page.get_by_label("Run", exact=True).input_value() == second.name)
    wait_until(lambda: page.get_by_label("With", exact=True).input_value() == first.name)
    page.get_by_label("With", exact=True).click()
    others = page.get_by_role("option").all_inner_texts()
    assert first.name in others and second.name not in others, "nothing is compared with itself"
    page.keyboard.press("Escape")
    page.get_by_text("iterations 8").first.wait_for()

    page.get_by_role("button", name="Overlay both runs").click()
    page.get_by_role("tab", name="Two runs").click()
    page.locator(".js-plotly-plot:visible").first.wait_for(timeout=60_000)
    page.get_by_text("k2 backlash").last.wait_for()

    page.get_by_role("tab", name="Rerun").click()
    page.get_by_role("button", name="Open in Rerun, here").click()
    frame = page.frame_locator("iframe.emaviz-rerun")
    frame.locator("#the_canvas_id").wait_for(timeout=60_000, state="attached")
    for looks in ("dark", "light"):
        page.get_by_label("Dark", exact=True).set_checked(looks == "dark")
        page.locator(f"iframe.emaviz-rerun[src$='&theme={looks}']").wait_for(timeout=20_000)
    page.get_by_role("button", name="Close the viewer").click()
    page.locator("iframe.emaviz-rerun").wait_for(state="detached")

    page.get_by_text("Rename or delete").click()
    field(page, "New name").fill("kept")
    page.get_by_role("button", name="Rename").click()
    wait_until(lambda: page.get_by_label("Run", exact=True).input_value() == "kept.rrd")
    page.get_by_role("button", name="Delete…").click()
    page.get_by_role("button", name="Keep it").click()
    page.get_by_role("button", name="Delete…").click()
    page.get_by_role("button", name="Delete it").click()
    wait_until(lambda: not (session.folder / "kept.rrd").exists())
    wait_until(lambda: page.get_by_label("Run", exact=True).input_value() == first.name)
    session.settings.set_fault(1, 0.0)
