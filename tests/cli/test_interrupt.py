"""Ctrl-C ends the program at any moment: exit code 130, and no traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from support.representative import first_of

from emaviz.cli import main

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="sends an interrupt")

COMMANDS = {
    "gui": ["gui", "--no-open", "--port", "0", "--data-dir", "data"],
    "simulate": ["simulate", "--model", "mm", "--out", "out.csv", "--record", "out.rrd"],
    "identify": ["identify", "--iterations", "5000", "--algorithm", "ssa", "--record", "out.rrd"],
    "compare": ["compare", "in.csv", "--record", "out.rrd"],
}
# What was just imported when the interrupt comes.
MOMENTS = {
    "gui": ("emaviz.cli.interrupt", "argparse", "numpy", "numba", "scipy", "pyarrow", "viser", "emaviz.page.app"),
    "compare": ("emaviz.cli.interrupt", "argparse", "numpy", "numba", "ema_model.comparison", "pyarrow"),
}
QUICK = (
    ("gui", "emaviz.cli.interrupt"),
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
from emaviz.cli.interrupt import until_interrupted

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
from emaviz.cli.interrupt import until_interrupted

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


def test_a_caller_of_main_keeps_its_own_handling(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = signal.getsignal(signal.SIGINT), threading.excepthook
    assert main(["effects", "--json", "a.json"]) == 0
    assert (signal.getsignal(signal.SIGINT), threading.excepthook) == before


LEFT = """
import sys, threading
from emaviz.cli import main

sys.argv = ["emaviz", "compare", "--fruit"]
code = main()
print(code, [thread.name for thread in threading.enumerate()])
"""


def test_no_thread_outlives_main(process_of):
    out, _ = process_of("-c", LEFT).communicate(timeout=60)
    assert out == "2 ['MainThread']\n"
