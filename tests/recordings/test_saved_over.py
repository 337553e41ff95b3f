"""TOML files that are saved over: a person's comments, order and spelling stay; of several savers none is lost."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ema_model.actuator import load_actuator, save_actuator
from ema_model.actuator.parameters import Tolerance
from ema_model.errors import InputError
from ema_model.files import written
from ema_model.files.written import FileLock, inline, toml_text
from ema_model.recordings import ColumnMapping, MappedColumn, SideFile, change_side_file, read_side_file
from ema_model.recordings.formats.text_layout import Hints

SHIPPED = Path(__file__).parents[2] / "assets" / "actuators"
SIDE = """\
# Bench 3, after the new sensor was glued on
kind = "run"        # not a map
actuator = 'rig.toml'

# The glue settles for 0.2 s.
[window]
from_s = 2e-1       # see the logbook

# From the data sheet
[sensors]
encoder_bits = 16

[mapping]           # as the PLC names them
motor_speed_rad_s = "n[rpm]"
current_A = { column = "iq", unit = "mA" }  # the drive's own

# torque: not wired
"""


def test_a_side_files_comments_and_order_stay(tmp_path):
    path = tmp_path / "run.toml"
    path.write_text(SIDE, encoding="utf-8")
    known = read_side_file(path).mapping
    assert known is not None
    rest = [one for one in known.entries if one.signal == "motor_speed_rad_s"]
    change_side_file(path, SideFile())
    assert path.read_text(encoding="utf-8") == SIDE.replace(
        "actuator = 'rig.toml'\n", "actuator = 'rig.toml'\nschema = 1\n"
    )
    mapping = ColumnMapping((MappedColumn("current_A", "iq_ref", "A"), *rest))
    change_side_file(path, SideFile(), mapping=mapping, text=Hints(header_line=3), window_s=None)
    assert (
        path.read_text(encoding="utf-8")
        == """\
# Bench 3, after the new sensor was glued on
kind = "run"        # not a map
actuator = 'rig.toml'
schema = 1

# From the data sheet
[sensors]
encoder_bits = 16

[mapping]           # as the PLC names them
motor_speed_rad_s = "n[rpm]"
current_A = { column = "iq_ref", unit = "A" }  # the drive's own

[text]
header_line = 3

# torque: not wired
"""
    )


def test_an_improved_actuator_keeps_what_was_noted_in_its_file(tmp_path):
    mine = tmp_path / "mine.toml"
    text = (SHIPPED / "thesis.toml").read_text(encoding="utf-8")
    mine.write_text(text.replace("[motor]", "# Rewound in March\n[motor]"), encoding="utf-8")
    known = load_actuator(mine)
    better = known.with_values({"motor.inertia_kgm2": 1.5e-5})
    save_actuator(better, tmp_path / "better.toml")
    again = (tmp_path / "better.toml").read_text(encoding="utf-8")
    changed = set(mine.read_text(encoding="utf-8").splitlines()) - set(again.splitlines())
    assert all(line.startswith("inertia_kgm2") for line in changed) and len(changed) == 1, changed
    assert "# Rewound in March\n[motor]" in again and load_actuator(tmp_path / "better.toml") == better
    # What is noted in the file that is replaced goes before.
    (tmp_path / "better.toml").write_text("# The best so far\n" + again, encoding="utf-8")
    best = replace(better, tolerances=better.tolerances | {"motor.inertia_kgm2": Tolerance(1e-7, free=False)})
    save_actuator(best, tmp_path / "better.toml")
    assert (tmp_path / "better.toml").read_text(encoding="utf-8").startswith("# The best so far\n")
    assert load_actuator(tmp_path / "better.toml") == best


@pytest.mark.parametrize("there", ["kind = ", "\x00", "x = 1\nx = 2", "é".encode("latin-1"), "a." * 5000 + "b = 1"])
def test_what_is_no_toml_is_replaced(there, tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(there if isinstance(there, bytes) else there.encode())
    save_actuator(load_actuator(), path)
    assert load_actuator(path) == load_actuator()
    if isinstance(there, str):
        path.write_text(there)
        with pytest.raises(InputError, match="is not valid TOML"):
            change_side_file(path, SideFile(), kind="map")
        assert path.read_text() == there


simple = st.text(max_size=6) | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | st.booleans()
keys = st.text(max_size=4) | st.sampled_from(["a", "b", "c"])
values = st.recursive(simple, lambda one: st.lists(one, max_size=3) | st.dictionaries(keys, one, max_size=3))
documents = st.dictionaries(
    keys, values.map(inline) | st.dictionaries(keys, values.map(inline), max_size=3), max_size=4
)


@settings(deadline=None, max_examples=25)
@given(documents, documents)
def test_whatever_stood_there_what_is_said_now_is_written(before, now):
    old = f"# first\n{toml_text(before)}# last\n"
    new = toml_text(now, old)
    assert new.startswith("# first\n") and "# last\n" in new
    assert tomllib.loads(new) == tomllib.loads(toml_text(now))


ADDING = """
import sys
from ema_model.files.written import change_file, toml_of, toml_text
path, name, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
print("ready", flush=True)
sys.stdin.readline()
for number in range(count):
    change_file(path, lambda text: toml_text(toml_of(text) | {f"{name}{number}": number}, text), 100_000)
"""


def started(*arguments: str) -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    process = subprocess.Popen([sys.executable, "-c", *arguments], stdin=pipe, stdout=pipe, text=True)
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    return process


def test_two_who_save_at_once_lose_nothing(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("# of both\n")
    savers = [started(ADDING, str(path), name, "40") for name in "ab"]
    for one in savers:
        assert one.stdin is not None
        one.stdin.write("\n")
        one.stdin.flush()
    for one in savers:
        one.communicate(timeout=60)
        assert one.returncode == 0
    text = path.read_text()
    assert text.startswith("# of both\n")
    assert tomllib.loads(text) == {f"{name}{number}": number for name in "ab" for number in range(40)}
    assert [one.name for one in tmp_path.iterdir()] == ["a.toml"]


HOLDING = """
import sys, time
from ema_model.files.written import change_file
def change(text):
    print("ready", flush=True)
    time.sleep(60)
change_file(sys.argv[1], change, 100_000)
"""


def test_a_killed_holders_lock_does_not_block(tmp_path, monkeypatch):
    path = tmp_path / "a.toml"
    holder = started(HOLDING, str(path))
    try:
        lock = written.lock_path(path)
        assert FileLock.acquire(lock) is None and FileLock.is_held(lock)
    finally:
        holder.kill()
        holder.communicate()
    assert lock.exists() and not FileLock.is_held(lock)
    monkeypatch.setattr(written, "_LONGEST_S", 0.0)  # without any wait
    change_side_file(path, SideFile(), sampling="mean")
    assert read_side_file(path).sampling == "mean" and [one.name for one in tmp_path.iterdir()] == ["a.toml"]
