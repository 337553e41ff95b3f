"""A result that is not of what is chosen says so, by one rule for all tabs; and what a session lacks is named."""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from support.on_page import wait_until

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.faults import HEALTHY
from ema_model.recordings import write_measurement
from ema_model.simulation.run import Run, simulate_reference
from ema_model.tracking.flights import Flight
from emaviz.session import session_file
from emaviz.session.campaigns import Campaigns
from emaviz.session.compare import Comparing
from emaviz.session.data_folder import DataFolder
from emaviz.session.discover import Discovering
from emaviz.session.explore import Session
from emaviz.session.fleet import ComparingUnits
from emaviz.session.jobs import Job, Worker
from emaviz.session.jobs import Run as JobRun
from emaviz.session.session_file import Inputs, Part, Provenance, results_part, version_of
from emaviz.session.track import Following

FILES = {"bench": ("chirp.csv", "step.csv"), "fleet/a": ("sine.csv",), "fleet/b": ("sine.csv",)}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("one") / "one.csv"
    write_measurement(simulate_reference(Run(command("chirp", {}), 0.01), load_actuator(), HEALTHY), path)
    return path


@pytest.fixture
def app(tmp_path, recording):
    """All sessions' parts, without a screen; no run begins by itself, as the compute thread is taken."""
    data = DataFolder(tmp_path / "data")
    for folder, names in FILES.items():
        (data.folder / folder).mkdir(parents=True)
        for name in names:
            shutil.copy(recording, data.folder / folder / name)
    session = Session(load_actuator(), data.recordings)
    files = Worker("test-files", lambda error: None)
    comparing = Comparing(session, data)
    session.open_file, session.version_of = comparing.measurement, comparing.version
    app = SimpleNamespace(
        data=data,
        session=session,
        compare=comparing,
        discover=Discovering(session, comparing),
        identify=session.identifying,
        units=ComparingUnits(session, data, files),
        track=Following(session, data, files),
    )
    for name in FILES["bench"]:
        comparing.add(f"bench/{name}")
    wait_until(lambda: len(comparing.opened) == 2)
    session.settings.set("source", "bench/chirp.csv")
    app.units.choose("fleet")
    app.track.choose("bench")
    app.track.watching = False
    yield app
    app.track.close()
    app.discover.close()
    comparing.close()
    session.close()
    files.close()


def rewritten(app, name):
    path = app.data.folder / name
    path.write_text(path.read_text() + "\n")
    os.utime(path, ns=(1, 1))


def gone(app, name):
    (app.data.folder / name).unlink()


def more(app, name):
    shutil.copy(app.data.folder / FILES_OF[name.partition("/")[0]], app.data.folder / name)


FILES_OF = {"bench": "bench/chirp.csv", "fleet": "fleet/a/sine.csv"}
CHANGES = [
    ("compare", lambda app: app.compare.remove("bench/step.csv"), "step.csv was removed since; press Compare."),
    ("compare", lambda app: rewritten(app, "bench/step.csv"), "step.csv was changed since; press Compare."),
    ("compare", lambda app: app.compare.set_window(0.0, 0.02), "the window of time was changed since; press Compare."),
    (
        "compare",
        lambda app: app.compare.set_weight("current_A", 2.0),
        "the weight of the equivalent current was changed since; press Compare.",
    ),
    ("compare", lambda app: setattr(app.compare, "calibrate", False), "the calibration was changed since"),
    ("compare", lambda app: app.compare.choose_actuator(app.compare.actuators()[1]), "the actuator"),
    ("discover", lambda app: app.compare.remove("bench/step.csv"), "step.csv was removed since; press Start."),
    ("discover", lambda app: rewritten(app, "bench/step.csv"), "step.csv was changed since; press Start."),
    (
        "discover",
        lambda app: app.discover.source.hold_out("bench/step.csv", True),
        "what is held out was changed since; press Start.",
    ),
    ("identify", lambda app: rewritten(app, "bench/chirp.csv"), "chirp.csv was changed since; press Identify."),
    ("identify", lambda app: app.session.settings.set("seed", 9), "seed was changed since; press Identify."),
    ("identify", lambda app: app.session.settings.set("source", ""), "another source was chosen since; press Identify"),
    ("units", lambda app: gone(app, "fleet/b/sine.csv"), "sine.csv was removed since; press Compare units."),
    ("units", lambda app: more(app, "fleet/b/step.csv"), "step.csv was added since; press Compare units."),
    ("units", lambda app: setattr(app.units, "rule", "sine*"), "the rule to hold out was changed since"),
    ("track", lambda app: gone(app, "bench/step.csv"), "step.csv was removed since; press Track."),
    ("track", lambda app: more(app, "bench/x.csv"), "x.csv was added since; press Track."),
    ("track", lambda app: app.track.set_threshold("k1", 0.5), "the threshold of k1 was changed since; press Track."),
]


@pytest.mark.parametrize(("tab", "change", "line"), CHANGES, ids=lambda one: one if isinstance(one, str) else "")
def test_a_result_says_what_has_changed_since_and_what_to_press(app, tab, change, line):
    provenance = getattr(app, tab).provenance
    assert provenance.line() == "", "there is no result"
    provenance.take()
    assert provenance.line() == "" and provenance.note() == ""
    change(app)
    assert provenance.line().startswith("Out of date: ") and line in provenance.line()
    assert "since" in provenance.note(), "what is written says it too"
    provenance.take()
    assert provenance.line() == "", "it is computed again"


def test_the_sliders_plant_counts_where_it_is_what_is_identified(app):
    settings, provenance = app.session.settings, app.identify.provenance
    provenance.take()
    settings.set_fault(0, 0.3)
    assert provenance.line() == "", "a file is identified"
    settings.set("source", "")
    provenance.take()
    settings.set_fault(0, 0.4)
    settings.set("monitor", "same faults")
    assert provenance.line() == "Out of date: k1 was changed since; press Identify."
    settings.set_fault(1, 0.4)
    settings.set("iterations", 99)
    assert "k1, k2 and iterations were changed" in provenance.line().replace(
        "iterations, k1 and k2", "k1, k2 and iterations"
    )


def test_another_one_that_is_computed_marks_the_one_before(worker):
    job = Job(worker)
    provenance = Provenance("the comparison", "Compare", lambda: Inputs("a.csv"), job)
    provenance.take()
    lines = []
    assert provenance.begin(lambda: job.begin("Comparing", lambda tell: lines.append(provenance.line())))
    wait_until(lambda: lines and not job.running, 20.0)
    assert lines == ["Out of date: another one is being computed."] and provenance.line() == ""
    assert not provenance.begin(lambda: False) and provenance.line() == "", "nothing was begun"


def test_an_error_goes_with_what_it_was_said_of(worker):
    chosen = {"bad.csv": "1"}
    job = Job(worker, on_divergence="x")
    provenance = Provenance("the comparison", "Compare", lambda: Inputs(files=dict(chosen)), job)

    def fail(_):
        raise FloatingPointError("bad.csv diverged")

    assert provenance.begin(lambda: job.begin("Comparing", fail))
    wait_until(lambda: job.error and not job.running, 20.0)
    assert not provenance.forget_error() and "bad.csv" in job.error
    del chosen["bad.csv"]
    assert provenance.forget_error() and not job.error and not provenance.forget_error()
    provenance.refused()
    assert not provenance.forget_error()


def test_flights_that_were_removed_or_replaced_are_not_followed_on(app, monkeypatch):
    track, asked = app.track, []

    def identified(recording, name, *_, **__):
        asked.append(name)
        return SimpleNamespace(name=name, excluded="", common=np.zeros((8, 3)))

    monkeypatch.setattr("emaviz.session.track.identified", identified)
    monkeypatch.setattr(track, "_follow", lambda *_: None)
    monkeypatch.setattr(track, "_show_so_far", lambda *_: None)
    monkeypatch.setattr("emaviz.session.track.check_enough", lambda *_: None)
    folder = app.data.folder / "flights"
    folder.mkdir()
    for number in range(3):
        shutil.copy(app.data.folder / "bench" / "chirp.csv", folder / f"flight_{number}.csv")
    (folder / "flight_9.csv").write_text("nonsense")
    track.choose("flights")
    assert track.begin()
    wait_until(lambda: not track.job.running and len(asked) == 3)
    assert len(track.complaints) == 1 and "flight_9" in track.complaints[0]
    (folder / "flight_9.csv").unlink()
    assert not track.complaints, "what was said of a file goes with it"
    (folder / "flight_0.csv").unlink()
    rewritten(app, "flights/flight_1.csv")
    del asked[:]
    assert track.begin()
    wait_until(lambda: not track.job.running and asked)
    assert asked == ["flight_1"] and {path.stem for path in track._flights} == {"flight_1", "flight_2"}


def test_a_campaigns_table_is_out_of_date_once_there_are_more_rows(app):
    campaigns = Campaigns(app.session, app.data)
    folder = app.data.folder / "robust"
    (folder / "parts").mkdir(parents=True)
    (folder / "campaign.json").write_text("{}")
    provenance = Provenance("the table", "Look for campaigns again", lambda: campaigns.inputs("robust"))
    provenance.take()
    assert provenance.line() == ""
    (folder / "parts" / "identify-1.parquet").write_bytes(b"rows")
    assert provenance.line() == "Out of date: the set of its rows was changed since; press Look for campaigns again."


# --- sessions ---------------------------------------------------------------------------------------------------------


TABS = ("compare", "discover", "identify", "units", "track")


def members(app):
    return {name: getattr(app, name).provenance for name in TABS}


def brought(app, saved, names=None):
    part = results_part(lambda: members(app))
    part.restore(json.loads(json.dumps(saved)), names or {})


@pytest.mark.parametrize("tab", TABS)
def test_a_session_says_what_must_be_computed_again_and_what_to_press(app, tab):
    provenance = getattr(app, tab).provenance
    provenance.take()
    saved = results_part(lambda: members(app)).save()
    assert list(saved) == [tab]
    provenance.clear()
    brought(app, saved)
    line = provenance.line()
    assert line.startswith("To be computed again: the ") and line.endswith(f"; press {provenance.start}.")
    assert f" of {provenance.now().subject}, which this session was saved with" in line
    assert not [one for name, one in members(app).items() if name != tab and one.line()]
    assert results_part(lambda: members(app)).save() == saved, "saved again before it is computed, it is not lost"
    provenance.take()
    assert provenance.line() == ""


def test_a_file_is_known_again_by_what_is_in_it(tmp_path):
    """Also where a session has taken it to another folder, and where it was written again as it was."""
    one, other = tmp_path / "a.csv", tmp_path / "elsewhere.csv"
    one.write_text("time_s,current_A\n0,1\n")
    other.write_bytes(one.read_bytes())
    os.utime(other, ns=(1, 1))
    assert version_of(one) == version_of(other) != ""
    other.write_text("time_s,current_A\n0,2\n")  # of the same length
    os.utime(other, ns=(2, 2))
    assert version_of(one) != version_of(other) and version_of(tmp_path / "none.csv") == ""
    assert version_of(one, "read so") != version_of(one, "read otherwise")


def test_what_was_running_is_said_too(app):
    job, provenance = app.compare.job, app.compare.provenance
    job.running, job._run = True, JobRun("Calibrating and comparing", print, app.session.worker)
    saved = results_part(lambda: members(app)).save()
    job.running = False
    assert saved == {"compare": {"inputs": None, "running": "Calibrating and comparing"}}
    brought(app, saved)
    assert provenance.line() == (
        "Not computed: “Calibrating and comparing” was running when this session was saved; press Compare."
    )


def test_a_result_that_is_here_is_not_said_to_be_missing_for_what_was_running_beside_it(app):
    job, provenance = app.units.job, app.units.provenance
    provenance.take()
    job.running, job._run = True, JobRun("Comparing units", print, app.session.worker)
    saved = results_part(lambda: members(app)).save()
    job.running = False
    provenance.clear()
    provenance.restored()
    brought(app, saved)
    assert provenance.line() == (
        "Not computed: “Comparing units” was running when this session was saved; press Compare units."
    )
    assert results_part(lambda: members(app)).save() == saved


def test_a_result_that_a_session_brings_itself_keeps_what_it_is_of(app):
    provenance = app.units.provenance
    provenance.take()
    app.units.rule = "sine*"
    saved = results_part(lambda: members(app)).save()
    provenance.clear()
    provenance.restored()
    brought(app, saved)
    assert provenance.line() == "Out of date: the rule to hold out was changed since; press Compare units."


def test_a_session_of_today_and_one_without_results_are_both_read(app, tmp_path):
    parts = {"results": results_part(lambda: members(app)), "other": Part(dict, lambda *_: None)}
    app.units.provenance.take()
    path = session_file.free_path(app.data, "kept")
    session_file.write_session(path, parts, app.data, [])
    app.units.provenance.clear()
    session_file.read_session(path, parts, app.data)
    assert app.units.provenance.line().startswith("To be computed again: the comparison of fleet")
    app.units.provenance.clear()
    with zipfile.ZipFile(tmp_path / "old.emaviz", "w") as archive:
        archive.writestr("session.json", json.dumps({"schema": 1, "files": []}))
    session_file.read_session(tmp_path / "old.emaviz", parts, app.data)
    assert not app.units.provenance.line()


def test_flights_that_were_identified_so_far_are_saved(app):
    """Also before there are enough of them to be followed, as while they are being identified."""
    flight = Flight("chirp", np.zeros(8), np.eye(8), np.zeros((8, 3)))
    app.track._flights = {app.data.folder / "bench" / "flight_1.csv": flight}
    saved = app.track.saved()
    assert [one["file"] for one in saved["flights"]] == ["flight_1.csv"]
    assert [one["fields"]["name"] for one in saved["whole"]["fields"]["flights"]] == ["chirp"]


def test_a_discovery_whose_story_is_not_there_is_not_lost_when_it_is_saved_again(app):
    discover = app.discover
    saved = {"recipe": {"challenge": "first_bench_run"}, "says": "1 added, 1.1 × floor"}
    discover.restore(saved, {})
    assert not discover.running and not discover.job.waiting and len(discover.entries.all) == 1
    again = discover.saved()
    assert again["recipe"]["challenge"] == "first_bench_run" and again["says"] == saved["says"]
    discover.restore(again, {})
    assert len(discover.entries.all) == 1
