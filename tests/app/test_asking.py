"""A comparison that is asked for at any moment is made, or refused in words: while files are read, while others run."""

from __future__ import annotations

import threading

import pytest
from support.on_page import wait_until

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.recordings import write_measurement
from ema_model.simulation.run import Run, simulate_reference
from emaviz.session.compare import Comparing
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session


@pytest.fixture(scope="module")
def recording():
    run = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.2)
    return simulate_reference(run, load_actuator())


@pytest.fixture
def comparing(tmp_path, recording):
    folder = DataFolder(tmp_path / "data")
    for name in ("first", "second"):
        write_measurement(recording, folder.uploads / f"{name}.csv")
    session = Session(load_actuator(), folder.recordings)
    comparing = Comparing(session, folder)
    comparing.calibrate = False  # what is asked for here is over soon
    yield comparing
    comparing.close()
    session.close()


@pytest.fixture
def heard(comparing):
    """(missing, by hand), what a wait is for, and of how many recordings each comparison is."""
    missing, waits, compared = [], [], []
    comparing.events.missing.connect(lambda why, by_hand: why and missing.append((why, by_hand)))
    comparing.job.waits.connect(lambda text: text and waits.append(text))
    comparing.events.compared.connect(lambda found: compared.append(len(found.recordings)))
    return missing, waits, compared


def another_run(comparing, title):
    """A long run beside it; returns what ends it."""
    over = threading.Event()

    def steps():
        while not over.is_set():
            yield

    assert comparing.session.worker.start(steps(), title)
    return over.set


def test_asked_while_the_file_is_being_read_it_waits_for_it(comparing, heard, reads):
    missing, waits, compared = heard
    comparing.add("uploads/first.csv")
    comparing.asking.ask(by_hand=True)
    wait_until(lambda: waits)
    assert waits[0] == "Comparing: waiting for uploads/first.csv to be read …" and not comparing.running
    reads.set()
    wait_until(lambda: compared)
    assert compared == [1] and not missing and not comparing.job.waiting


def test_all_files_on_their_way_are_in_one_comparison(comparing, heard, reads):
    missing, waits, compared = heard
    for name in ("first", "second"):
        comparing.add(f"uploads/{name}.csv")
        comparing.events.opened.connect(lambda _: comparing.asking.ask(by_hand=False))
    comparing.asking.ask(by_hand=True)
    wait_until(lambda: waits)
    assert waits[0].endswith("uploads/first.csv and 1 more to be read …")
    reads.set()
    wait_until(lambda: compared and not comparing.running and not comparing.job.waiting)
    assert compared == [2] and not missing


def test_a_file_that_cannot_be_read_ends_the_wait_in_words(comparing, heard, reads):
    missing, waits, compared = heard
    (comparing.folder.uploads / "bad.csv").write_bytes(b"\x00\x01\x02" * 20)
    comparing.add("uploads/bad.csv")
    comparing.asking.ask(by_hand=True)
    wait_until(lambda: waits)
    reads.set()
    wait_until(lambda: missing)
    assert missing[0][1] and not comparing.job.waiting and not compared


def test_behind_another_long_run_it_waits_for_its_turn_and_can_be_stopped(comparing, heard):
    missing, waits, compared = heard
    comparing.add("uploads/first.csv")
    wait_until(lambda: comparing.opened)
    end = another_run(comparing, "Taking the session's steps again")
    comparing.asking.ask(by_hand=True)
    wait_until(lambda: waits)
    assert waits[0] == "Comparing: waiting for Taking the session's steps again …"
    comparing.job.stop()
    end()
    assert not comparing.job.waiting
    wait_until(lambda: not comparing.session.worker.busy)
    end = another_run(comparing, "Identifying")
    comparing.asking.ask(by_hand=True)
    end()
    wait_until(lambda: compared)
    assert compared == [1] and not missing, "the one that was stopped is not made"


def test_the_same_is_not_compared_twice_at_once_and_something_else_is_after_it(comparing, heard):
    missing, _, compared = heard
    go_on = threading.Event()
    comparing.add("uploads/first.csv")
    wait_until(lambda: comparing.opened)
    comparing.job.progressed.connect(lambda *_: go_on.wait(30.0))
    for _ in range(3):
        comparing.asking.ask(by_hand=True)  # a double click
    assert comparing.running and not comparing.job.waiting
    comparing.add("uploads/second.csv")
    wait_until(lambda: len(comparing.opened) == 2)
    comparing.asking.ask(by_hand=False)
    assert comparing.job.waiting
    go_on.set()
    wait_until(lambda: len(compared) == 2 and not comparing.running)
    assert compared == [1, 2] and not missing and not comparing.job.waiting


def test_nothing_chosen_is_said(comparing, heard):
    missing, _, _ = heard
    comparing.asking.ask(by_hand=True)
    (said,) = missing
    assert said[0].startswith("no measurement is chosen") and said[1]
