"""Ctrl-C ends the program at any moment: exit code 130, no traceback, and what was found so far."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time

import pytest
from support.documents import result_of
from support.representative import first_of

from emaviz.cli import main
from emaviz.recording import read

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="sends an interrupt")

COMMANDS = {
    "gui": ["gui", "--no-open", "--port", "0", "--data-dir", "data"],
    "simulate": ["simulate", "--model", "mm", "--out", "out.csv", "--record", "out.rrd"],
    "identify": ["identify", "--iterations", "5000", "--algorithm", "ssa", "--record", "out.rrd"],
    "compare": ["compare", "in.csv", "--record", "out.rrd"],
}
# What was just imported when the interrupt comes.
MOMENTS = {
    "gui": ("emaviz.cli.ending", "argparse", "numpy", "numba", "scipy", "pyarrow", "viser", "emaviz.page.app"),
    "compare": ("emaviz.cli.ending", "argparse", "numpy", "numba", "ema_model.comparison", "pyarrow"),
}
QUICK = (
    ("gui", "emaviz.cli.ending"),
    ("gui", "numba"),
    ("gui", "emaviz.page.app"),
    ("compare", "ema_model.comparison"),
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("interrupt") / "in.csv"
    assert main(["simulate", "--model", "mm", "--duration", "0.1", "--out", str(path)]) == 0
    return path


@pytest.fixture
def process_of(tmp_path):
    """Starts Python in tmp_path; it takes interrupts, even where those who run the tests ignore them."""
    started = []

    def process_of(*arguments, **environment):
        started.append(
            subprocess.Popen(
                [sys.executable, *arguments],
                cwd=tmp_path,
                env={**os.environ, "PYTHONUNBUFFERED": "1", **environment},
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            )
        )
        return started[-1]

    yield process_of
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def start(process_of, tmp_path, recording):
    """Starts a command."""
    (tmp_path / "in.csv").symlink_to(recording)
    return lambda command, *options, **environment: process_of(
        *options, "-m", "emaviz", *COMMANDS[command], **environment
    )


@pytest.fixture
def running(process_of):
    """A program that has said that it is ready."""

    def running(code):
        process = process_of("-c", code)
        assert process.stdout.readline() == "ready\n"
        return process

    return running


def interrupted(process, times=1):
    """What a process still says on stdout and stderr when an interrupt ends it."""
    for _ in range(times):
        process.send_signal(signal.SIGINT)
        time.sleep(0.01)
    out, said = process.communicate(timeout=60)  # on a loaded machine, too
    assert process.returncode == 130, (process.returncode, said)
    return out, "".join(line for line in said.splitlines(keepends=True) if not line.startswith("import time:"))


@pytest.mark.parametrize(
    "command, moment",
    [
        pytest.param(command, moment, marks=() if (command, moment) in QUICK else pytest.mark.long)
        for command, moments in MOMENTS.items()
        for moment in moments
    ],
)
def test_an_interrupt_while_importing_ends_it(start, command, moment):
    process = start(command, "-X", "importtime")
    for line in process.stderr:
        if line.rstrip().endswith((f" {moment}", " emaviz.page.app")):  # the last one
            break
    assert line.rstrip().endswith(f" {moment}")
    assert interrupted(process)[1] == ""


@pytest.mark.parametrize("after_s", first_of([1.0, 0.05, 0.3, 3.0, 6.0]))
def test_an_interrupt_after_a_while_ends_it(start, after_s, tmp_path):
    """With an empty cache, so that they compile: the page in a thread of its own, the others in the main one."""
    processes = {name: start(name, EMAVIZ_CACHE_DIR=str(tmp_path / f"cache of {name}")) for name in COMMANDS}
    time.sleep(after_s)
    for process in processes.values():
        process.send_signal(signal.SIGINT)
    for name, process in processes.items():
        _, said = process.communicate(timeout=60)
        # Before the first line of the command line, Python itself is what is interrupted.
        early = after_s < 0.5 and "emaviz/cli" not in said
        assert (process.returncode == 130 and said == "") or early, (name, process.returncode, said)


@pytest.mark.long
@pytest.mark.parametrize("command", ["gui", "identify"])
def test_a_second_interrupt_ends_it_at_once(start, command, tmp_path):
    process = start(command, EMAVIZ_CACHE_DIR=str(tmp_path / "cache"))
    time.sleep(2.0)
    assert interrupted(process, times=3)[1] == ""


STUCK = """
import sys, threading, time
from emaviz.cli.ending import until_interrupted

def run():
    print("ready", flush=True)
    while True:
        try:
            {stuck}
        except KeyboardInterrupt:
            pass

sys.exit(until_interrupted(run))
"""


@pytest.mark.parametrize(
    "stuck", ["time.sleep(60)", "__import__('ctypes').CDLL(None).pause()"], ids=["swallowed", "native code"]
)
def test_what_swallows_the_interrupt_ends_as_well(running, stuck):
    assert interrupted(running(STUCK.format(stuck=stuck))) == ("", "")


CLOSING = """
import atexit, sys, threading, time
from emaviz.cli.ending import until_interrupted

def run():
    threading.Thread(target=time.sleep, args=(60,)).start()  # that Python would wait for
    atexit.register(print, "at exit", flush=True)
    try:
        print("ready", flush=True)
        time.sleep(60)
    finally:
        print("closed", flush=True)

sys.exit(until_interrupted(run))
"""


def test_what_is_open_is_closed_first(running):
    assert interrupted(running(CLOSING)) == ("closed\nat exit\n", "")


# Commands that say "ready" once they have a part of their answer, and go on for long.
IDENTIFY = """
import sys, time
from ema_model.identification import run
engine = run.identify

def identify(*arguments, on_iteration, **options):
    def after(at):
        on_iteration(at)
        if at.iteration == 2:
            print("ready", flush=True)
            time.sleep(60)
    return engine(*arguments, on_iteration=after, **options)

run.identify = identify
"""
DISCOVER = """
import sys, time
import ema_model.discovery
engine = ema_model.discovery.discover

def discover(*arguments, on_progress, stop, **options):
    def said(text):
        on_progress(text)
        if text.startswith("scoring"):
            print("ready", flush=True)
            while not stop():
                time.sleep(0.01)
    return engine(*arguments, on_progress=said, stop=stop, candidates=["cogging_torque"], **options)

ema_model.discovery.discover = discover
"""
TRACK = """
import sys, time
from ema_model.simulated_lives import drawn, worn_life
from ema_model.tracking import flights

def identify_all(*_):
    yield from drawn(worn_life("linear", 1))[:{flights}]
    print("ready", flush=True)
    time.sleep(60)

flights.identify_all = identify_all
"""
PROGRAM = """
from emaviz.__main__ import program
sys.exit(program())
"""


@pytest.fixture
def cut_off(process_of, tmp_path):
    """What a command prints that is interrupted once it has a part of its answer, and what it writes."""

    def cut_off(code, *arguments):
        process = process_of("-c", code + PROGRAM, *arguments, "--quiet", "--json", "found.json", PYTHONUNBUFFERED="")
        assert process.stdout.readline() == "ready\n"
        out, said = interrupted(process)
        assert said == ""
        written = tmp_path / "found.json"
        return out, result_of(written, arguments[0]) if written.exists() else None

    return cut_off


def test_an_identification_that_is_interrupted_says_its_best_so_far(cut_off, tmp_path):
    line = ["identify", "--algorithm", "do", "--population", "4", "--duration", "0.05"]
    out, found = cut_off(IDENTIFY, *line, "--record", "out.rrd", "--report", "out.html")
    assert out.startswith("Interrupted at iteration 2 of 150 of Dandelion: the best k so far")
    assert f"k1  {found['k'][0]:.4f}" in out and "--report: not written" in out
    assert found["interrupted"] and found["k_interval90"] is None
    assert found["rmse"] == found["history"]["rmse"][-1] and len(found["history"]["k"]) == 3
    assert read(tmp_path / "out.rrd").complete


def test_a_discovery_that_is_interrupted_says_what_it_has_so_far(cut_off, recording):
    out, found = cut_off(DISCOVER, "discover", str(recording))
    assert found["verdict"] == "interrupted" and [one["kind"] for one in found["ladder"]] == ["calibrated"]
    assert found["calibration"]["parameters"] and found["effects"] == []
    assert out.startswith("interrupted") and "error ladder" in out


@pytest.mark.parametrize("flights", [12, 3])
def test_a_tracking_that_is_interrupted_says_what_the_flights_so_far_say(cut_off, recording, tmp_path, flights):
    (tmp_path / "unit").mkdir()
    for number in range(50):
        shutil.copy(recording, tmp_path / "unit" / f"flight_{number}.csv")
    out, found = cut_off(TRACK.format(flights=flights), "track", "unit")
    assert out.startswith(f"Interrupted: {flights} of 50 flights are identified.")
    if flights == 3:
        assert "A trend needs" in out and "--json: not written" in out and found is None
    else:
        assert found["interrupted"] and (found["flights_identified"], found["flights_named"]) == (12, 50)
        assert "k1" in found["faults"]


WRITING = """
import sys, time
from emaviz.cli.ending import PartialAnswer, until_interrupted

def run():
    try:
        with PartialAnswer() as answer:
            answer.grows()
            print("ready", flush=True)
            time.sleep(60)
    except KeyboardInterrupt:
        time.sleep(2.5)
        print("written")
    return 130

sys.exit(until_interrupted(run))
"""


def test_a_part_of_an_answer_has_time_to_be_written(running):
    assert interrupted(running(WRITING)) == ("written\n", "")


def test_a_part_of_an_answer_leaves_a_second_interrupt_its_way(running):
    assert interrupted(running(WRITING), times=2) == ("", "")


def test_a_caller_of_main_keeps_its_own_handling(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = signal.getsignal(signal.SIGINT), threading.excepthook
    assert main(["effects", "--json", "a.json"]) == 0
    assert (signal.getsignal(signal.SIGINT), threading.excepthook) == before


LEFT = """
import atexit, sys, threading
from emaviz.cli import main

atexit.register(lambda: print([thread.name for thread in threading.enumerate()], flush=True))
sys.argv = ["emaviz", "compare", "--fruit"]
main()
"""


def test_no_thread_outlives_main(process_of):
    process = process_of("-c", LEFT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 2 and out == "['MainThread']\n"


def test_a_refusal_waits_for_no_thread(process_of):
    """Threads of Arrow's that have hardly begun as the program ends would abort it (exit code 134)."""
    program = """
import sys, threading, time
from emaviz.cli import main
threading.Thread(target=time.sleep, args=(90.0,)).start()
sys.argv = ["emaviz", "compare", "missing.csv"]
sys.exit(main())
"""
    process = process_of("-c", program)
    _, said = process.communicate(timeout=45.0)
    assert process.returncode == 2 and "missing.csv: no such file" in said
