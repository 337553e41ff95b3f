"""The app without a browser: runs, stops, double starts, failures that it survives."""

from __future__ import annotations

import math
import shutil
import threading
import time

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from emaviz.recording import RecordingError, read
from emaviz.session.explore import Session, Simulation


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
    came = threading.Event()
    session.events.simulated.connect(lambda one: (runs.append(one), came.set()))

    def simulated():
        came.clear()
        session.refresh()
        assert came.wait(60.0)
        return runs[-1]

    first = simulated()
    session.settings.set_fault(0, 0.4)
    second = simulated()
    assert second.monitor is first.monitor and second.reference is not first.reference
    session.settings.set("monitor", "same faults")
    third = simulated()
    assert not np.array_equal(third.monitor["current_A"], first.monitor["current_A"])
    session.settings.set_command_setting("chirp", "amplitude_rad", 0.003)
    assert not np.array_equal(simulated().monitor["command_rad"], third.monitor["command_rad"])
    session.settings.set("load_torque_Nm", 5.0)
    assert "load_torque_Nm" in simulated().monitor
