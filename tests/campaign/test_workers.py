"""Workers of one host: each kernel is compiled once, on one thread, and what is compiled decides no digit."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

import pytest
from processes import environment
from support.cheap_plans import cheap

from ema_model.campaign import load_plan, store
from ema_model.campaign.rows import OtherVersion, Turns, row_of
from ema_model.campaign.run import Processes
from ema_model.campaign.store import version
from ema_model.simulation import pack

IMPORTED = re.compile(r"from ema_model\.campaign\.(\w+) import")
COMPILES = """
import sys
from pathlib import Path
from numba.core import event
from ema_model.campaign.rows import prepare
prepare()
from ema_model.commands import command
from ema_model.actuator import load_actuator
from ema_model.simulation.run import Run, simulate_monitor

class Compiled(event.Listener):
    def on_start(self, event):
        name = event.data["dispatcher"].py_func.__name__
        if name == "traces":
            print("compiled", name, flush=True)
    def on_end(self, event):
        pass

event.register("numba:compile", Compiled())
print("ready", flush=True)
sys.stdin.readline()
found = simulate_monitor(Run(duration_s=0.01), load_actuator())
import numba
print("threads", numba.get_num_threads(), "sum", float(found["current_A"].sum()).hex())
"""


@pytest.mark.long
def test_one_process_compiles_and_the_others_take_it(tmp_path):
    started = [
        subprocess.Popen(
            [sys.executable, "-c", COMPILES],
            env=environment(EMAVIZ_CACHE_DIR=str(tmp_path)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(3)
    ]
    for one in started:
        assert one.stdout is not None and one.stdout.readline() == "ready\n"
    for one in started:  # all at once, with nothing in the cache
        assert one.stdin is not None
        one.stdin.write("go\n")
        one.stdin.flush()
    told = [one.communicate(timeout=240)[0] for one in started]
    assert sum("compiled traces" in text for text in told) == 1, told
    assert all(one.returncode == 0 for one in started)
    (answer,) = {text.splitlines()[-1] for text in told}
    assert answer.startswith("threads 1 sum ")
    assert not list(tmp_path.rglob("*.lock"))


def test_a_lock_that_stays_is_waited_for_and_then_passed(tmp_path, monkeypatch):
    from ema_model.campaign import rows

    monkeypatch.setattr(rows, "_LONGEST_S", 0.2)
    first, second = Turns(), Turns()
    path = tmp_path / "kernel.nbc"
    first.begin(path)
    first.begin(path)  # a compilation that failed is tried again
    second.begin(path)
    second.end(path)
    first.end(path)
    second.begin(path)
    assert (tmp_path / "kernel.nbc.lock").exists()
    second.end(path)
    assert not (tmp_path / "kernel.nbc.lock").exists()


def test_what_is_compiled_does_not_choose_the_kernels(monkeypatch):
    monkeypatch.setattr(pack, "_only_library", False)  # whatever another test made of this process
    monkeypatch.setattr(pack, "is_known", lambda *_: True)
    monkeypatch.setattr(pack, "is_compiled", lambda *_: True)
    from ema_model.actuator import load_actuator

    actuator = load_actuator()
    assert pack.stack_at_hand(actuator, ["hinge_moment"], "reduced", "run").effects == ("hinge_moment",)
    pack.always_library()
    assert set(pack.stack_at_hand(actuator, ["hinge_moment"], "reduced", "run").effects) == set(pack.LIBRARY)
    assert pack.stack_at_hand(actuator, [], "reduced", "run").effects == ()


def test_a_worker_of_another_version_computes_nothing(tmp_path):
    (task,) = load_plan(cheap(tmp_path, 1)).tasks
    with pytest.raises(OtherVersion, match=r"differs from the campaign: emaviz .* / 0\.0\.9"):
        row_of(task, version() | {"emaviz": "0.0.9"})


def test_the_version_follows_every_file_that_a_result_depends_on(tmp_path, monkeypatch):
    shutil.copytree(store._PACKAGE / "campaign", tmp_path / "campaign")
    monkeypatch.setattr(store, "_PACKAGE", tmp_path)
    before = version.__wrapped__()["sources"]
    for file in _behind_a_result(tmp_path / "campaign"):
        text = file.read_text(encoding="utf-8")
        file.write_text(text + "# changed\n", encoding="utf-8")
        assert version.__wrapped__()["sources"] != before, f"another {file.name} gives other rows"
        file.write_text(text, encoding="utf-8")


def _behind_a_result(folder):
    """The kinds of tasks, and what they import of the campaign's folder."""
    files, new = set(), {folder / "kinds.py"}
    while new:
        files |= new
        named = {name for file in new for name in IMPORTED.findall(file.read_text(encoding="utf-8"))}
        new = {folder / f"{name}.py" for name in named if (folder / f"{name}.py").exists()} - files
    return sorted(files)


@pytest.mark.parametrize("asked", [1, 3, None])
def test_as_many_workers_as_asked_for_or_as_there_are_cores(asked):
    assert Processes(asked).workers == (asked or Processes().workers) >= 1
