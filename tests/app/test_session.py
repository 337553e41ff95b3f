"""The app without a browser: runs, stops, double starts, failures that it survives."""

from __future__ import annotations

import copy
import math
import shutil
import threading
import time

import numpy as np
import pytest
from support.on_page import wait_until

from ema_model.actuator import load_actuator
from emaviz.figures.identification import Marks, fault_bars, landscape_figure
from emaviz.page.identify import at_iteration
from emaviz.recording import RecordingError, read
from emaviz.session import session_file
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session, Simulation
from emaviz.session.identify import ends
from emaviz.session.session_file import results_part
from emaviz.text.verdicts import sure_words


@pytest.fixture
def session(tmp_path):
    session = Session(load_actuator(), tmp_path / "recordings")
    session.folder.mkdir()
    session.start()
    assert session.ready.wait(120.0)
    yield session
    session.close()


def identified(session, seconds=60.0):
    """Starts an identification and waits for its answer and path."""
    done, result = threading.Event(), []
    session.identifying.identified.connect(lambda race: (result.append((race.best.answer, race.path)), done.set()))
    assert session.identify()
    assert done.wait(seconds)
    return result[-1]


def test_an_identification_is_recorded_and_drawn(session):
    session.settings.set_fault(2, 0.3)
    session.settings.set("algorithms", ["do"])
    answer, path = identified(session)
    assert answer.error_percent < 1.0
    recording = read(path)
    assert set(recording.signals) >= {"reference", "monitor", "residual"}
    assert np.allclose(recording.truth, session.settings.k)
    assert recording.identification["do"].population.shape == (151, 50, 8)
    assert session.settings.monitor == "healthy", "an answer changes nothing that is shown elsewhere"


def test_only_one_identification_runs_however_often_it_is_asked(session):
    started = []
    gate = threading.Barrier(12)

    def click():
        gate.wait()
        started.append(session.identify())

    threads = [threading.Thread(target=click) for _ in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sum(started) == 1
    session.identifying.job.stop()


def test_stop_keeps_the_best_so_far(session):
    session.settings.set("iterations", 5000)
    session.settings.set("algorithms", ["hba"])
    done, result = threading.Event(), []
    session.identifying.identified.connect(lambda race: (result.append(race.best.answer), done.set()))
    begun = threading.Event()
    session.identifying.progressed.connect(lambda race: begun.set())
    assert session.identify()
    assert begun.wait(30.0)
    asked = time.perf_counter()
    session.identifying.job.stop()
    assert done.wait(10.0)
    print(f"stop took {1e3 * (time.perf_counter() - asked):.0f} ms")
    assert result[0].stopped and len(result[0].rmse_history) < 5001
    assert np.all(np.isfinite(result[0].k))


def test_a_run_goes_on_when_its_recording_cannot_be_written(session):
    told = []
    session.events.told.connect(lambda title, text: told.append(text))
    shutil.rmtree(session.folder)
    answer, path = identified(session)
    assert path is None and math.isfinite(answer.rmse)
    assert len(told) == 1 and "\n" not in told[0]


def test_a_diverging_model_is_told_and_the_session_goes_on(session, monkeypatch):
    told, drawn = threading.Event(), threading.Event()
    session.events.told.connect(lambda title, text: told.set())

    def diverge(*_, **__):
        raise FloatingPointError("the reference model diverged")

    with monkeypatch.context() as patch:
        patch.setattr("ema_model.simulation.plant.simulate_reference", diverge)
        session.refresh()
        assert told.wait(10.0)
    session.events.simulated.connect(lambda _: drawn.set())
    session.refresh()
    assert drawn.wait(10.0)


def test_reading_what_is_no_recording_is_told(tmp_path):
    with pytest.raises(RecordingError):
        read(tmp_path / "none.rrd")


def test_the_monitor_is_simulated_once_while_sliders_move_the_plant_alone(session):
    runs: list[Simulation] = []
    session.events.simulated.connect(runs.append)

    def simulated(is_it=lambda one: True):
        """The first that is it: one of the settings before may come in between."""
        runs.clear()
        session.refresh()
        wait_until(lambda: any(map(is_it, runs)), 60.0)
        return next(filter(is_it, runs))

    first = simulated()
    session.settings.set_fault(0, 0.4)
    second = simulated(lambda one: one.reference is not first.reference)
    assert second.monitor is first.monitor
    session.settings.set("monitor", "same faults")
    third = simulated(lambda one: not np.array_equal(one.monitor["current_A"], first.monitor["current_A"]))
    session.settings.set_command_setting("chirp", "amplitude_rad", 0.003)
    simulated(lambda one: not np.array_equal(one.monitor["command_rad"], third.monitor["command_rad"]))
    session.settings.set("load_torque_Nm", 5.0)
    simulated(lambda one: "load_torque_Nm" in one.monitor)


def stored_in(session, folder, name="kept"):
    """A session's file with what Identify has found."""
    data = DataFolder(folder)
    path = session_file.free_path(data, name)
    part = results_part(lambda: {"identify": session.identifying.provenance})
    session_file.write_session(path, {"results": part}, data, [])
    return path


def load(session, path, folder):
    """Takes it into another session."""
    part = results_part(lambda: {"identify": session.identifying.provenance})
    session_file.read_session(path, {"results": part}, DataFolder(folder))


def drawn(race):
    """All that the page draws of a race: convergence, swarm, answer, landscape."""
    frames = [[race.tracks[name], at_iteration(race.tracks[name], 3)] for name in race.tracks]
    answers = [[one.to_dict(), one.document.text, one.corrected_error.least] for one in race.answers]
    marks = Marks(race.best.k, race.best.answer.uncertainty.interval90, race.truth, ends(race))
    return [
        {name: race.errors_of(track) for name, track in race.tracks.items()},
        [(track.share, track.iterations, frame.k.tolist(), frame.population.tolist()) for track, frame in frames],
        [str(fault_bars(one.k, load_actuator(), race.truth, alarms=one.uncertainty.alarms)) for one in race.answers],
        answers,
        [race.time_s.tolist(), race.measured_A.tolist(), race.best.current_A.tolist()],
        [race.source, race.known, race.share, race.said, race.best.algorithm],
        {name: values.tolist() for name, values in race.measurement.signals.items()},
        None if race.landscape is None else landscape_figure(race.landscape, marks).to_json(),
        race.ways,
        sure_words(race.best.answer),
    ]


def test_a_session_shows_an_identification_as_it_was_and_computes_nothing(session, tmp_path, computed):
    session.settings.set_fault(2, 0.3)
    session.settings.set("algorithms", ["do", "robust"])
    session.settings.set("population", 12)
    session.settings.set("iterations", 6)
    assert stored_in(session, tmp_path / "here", "empty").is_file(), "nothing is found yet"
    identified(session)
    wait_until(lambda: not session.identifying.job.running)
    race, done = session.identifying.race, threading.Event()
    session.identifying.landscapes.drawn.connect(lambda *_: done.set())
    assert session.identifying.landscapes.draw(race, 0, 2, race.best.k, False) and done.wait(60.0)
    wait_until(lambda: not session.worker.busy)
    path = stored_in(session, tmp_path / "here")
    before = drawn(race)
    computed.clear()
    other = Session(load_actuator(), tmp_path / "there")
    other.folder.mkdir()
    brought, begun = [], []
    other.identifying.brought.connect(brought.append)
    other.identifying.job.began.connect(begun.append)
    other.settings.restore(session.settings.saved())
    try:
        load(other, path, tmp_path / "there" / "data")
        assert brought == [other.identifying.race] and not begun and not computed
        again = drawn(other.identifying.race)
        assert again == before and not computed
        assert other.identifying.answered_at == session.identifying.answered_at
        assert other.identifying.provenance.line() == ""
        assert other.identifying.race.path is None, "its recording is not in this folder"
        other.settings.set_fault(2, 0.4)
        assert other.identifying.provenance.line() == "Out of date: k3 was changed since; press Identify."
        some = np.array([race.best.k, session.settings.k])
        assert np.array_equal(other.identifying.race.error(some), race.error(some)), "a landscape can be drawn"
    finally:
        other.close()


DAMAGES = (
    lambda one: one["race"].update({"class": "Race"}),
    lambda one: one["race"]["fields"].update({"tracks": []}),
    lambda one: one["race"]["fields"].update({"at": "evil"}),
    lambda one: one["race"]["fields"].update({"measured_A": np.zeros(3)}),
    lambda one: one["race"]["fields"].update({"objective": {"class": "Path", "fields": {}}}),
    lambda one: one.update({"settings": 7}),
    lambda one: one.update({"race": 7}),
    lambda one: one.clear(),
)


def test_a_damaged_identification_is_to_be_computed_again(session):
    session.settings.set("algorithms", ["do"])
    session.settings.set("iterations", 2)
    identified(session)
    wait_until(lambda: not session.identifying.job.running)
    provenance = session.identifying.provenance
    good, of = results_part(lambda: {"identify": provenance}).save(), "the answer of the sliders' plant"
    for damage in DAMAGES:
        saved = copy.deepcopy(good)
        damage(saved["identify"]["whole"])
        provenance.clear()
        results_part(lambda: {"identify": provenance}).restore(saved, {})
        line = provenance.line()
        assert line.startswith(f"To be computed again: {of}, which this session was saved with (")
        assert line.endswith("); press Identify.") and "\n" not in line and len(line) < 300
