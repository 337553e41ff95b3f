"""The cache of compiled kernels: used only when it is the user's alone, and whole whatever happens to its files."""

from __future__ import annotations

import os
import pickle
import random
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path

import numba
import numpy as np
import pytest

import ema_model.stacks
from ema_model import kernel_cache
from ema_model.kernel_cache import cache_folder, kept
from ema_model.stacks import find_stack

PARENT = Path(ema_model.stacks.__file__).parents[1]
needs_modes = pytest.mark.skipif(sys.platform == "win32", reason="Windows tells neither owners nor modes")
needs_root = pytest.mark.skipif(
    sys.platform == "win32" or os.getuid() != 0, reason="only root can give a folder to another user"
)


@pytest.fixture
def root(tmp_path, monkeypatch):
    """An empty cache's root, which this process uses during the test."""
    path = tmp_path / "cache"
    monkeypatch.setenv("EMAVIZ_CACHE_DIR", str(path))
    monkeypatch.setattr(kernel_cache, "_told", [])
    kernel_cache._find.cache_clear()
    yield path
    kernel_cache._find.cache_clear()


def made(root: Path) -> Path:
    """The cache as a run of before has left it."""
    folder = cache_folder()
    assert folder.is_relative_to(root)
    kernel_cache._find.cache_clear()
    return folder


def assert_not_used(root: Path, capsys: pytest.CaptureFixture[str], why: str) -> None:
    folder = cache_folder()
    assert cache_folder() == folder and not folder.is_relative_to(root)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    [line] = capsys.readouterr().err.splitlines()
    assert why in line and "EMAVIZ_CACHE_DIR" in line


# --- whose it is ----------------------------------------------------------------------------------------------------


@needs_modes
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o1777, 0o702])
@pytest.mark.parametrize("depth", [0, 1, 2])
def test_a_cache_that_others_may_write_to_is_not_used(root, capsys, mode, depth):
    folder = [made(root), *made(root).parents][depth]
    folder.chmod(mode)
    assert_not_used(root, capsys, f"{folder} belongs to another user, or others may write to it")


@needs_root
@pytest.mark.parametrize("depth", [0, 1, 2])
def test_a_cache_of_another_user_is_not_used(root, capsys, depth):
    folder = [made(root), *made(root).parents][depth]
    os.chown(folder, 12345, 12345)
    assert_not_used(root, capsys, f"{folder} belongs to another user")


@needs_modes
def test_a_parent_where_others_may_swap_the_cache_counts(root, capsys):
    made(root)
    root.parent.chmod(0o777)
    assert_not_used(root, capsys, f"others may write to {root.parent}")
    kernel_cache._find.cache_clear()
    root.parent.chmod(0o1777)  # as /tmp
    assert cache_folder().is_relative_to(root) and not capsys.readouterr().err


@needs_root
def test_a_parent_of_another_user_or_group_counts(root, capsys):
    made(root)
    os.chown(root.parent, 12345, -1)
    assert_not_used(root, capsys, f"{root.parent} belongs to another user")
    kernel_cache._find.cache_clear()
    os.chown(root.parent, 0, 12345)
    root.parent.chmod(0o770)
    assert_not_used(root, capsys, f"others may write to {root.parent}")


@needs_modes
def test_a_link_counts_as_what_it_points_to(root, capsys, tmp_path):
    target = tmp_path / "elsewhere"
    target.mkdir(mode=0o700)
    root.symlink_to(target)
    assert cache_folder() == target.resolve() / "kernels" / cache_folder().name
    kernel_cache._find.cache_clear()
    target.chmod(0o777)
    assert_not_used(target, capsys, f"{target} belongs to another user, or others may write to it")


@needs_modes
def test_what_is_made_is_for_the_user_alone(root):
    before = os.umask(0)
    try:
        twice = tiny()
        assert twice(3.0) == 9.0
    finally:
        os.umask(before)
    modes = {path.suffix: stat.S_IMODE(path.stat().st_mode) for path in (root, *root.rglob("*"))}
    assert modes == {"": 0o700, ".nbc": 0o600}


PLANTED = """
from pathlib import Path
Path({marker!r}).touch()
"""


@needs_modes
@pytest.mark.parametrize("mode", [0o700, 0o777])
def test_a_planted_source_is_not_executed(root, tmp_path, mode):
    """No source is read from the cache, be it safe or not."""
    marker, folder = tmp_path / "executed", made(root)
    package = find_stack().monitor.__package__
    for name in (package, package.removeprefix("ema_model_")):
        (folder / name).mkdir()
        for module in ("__init__", "composition", "monitor"):
            (folder / name / f"{module}.py").write_text(PLANTED.format(marker=str(marker)))
    root.chmod(mode)
    found = run("from ema_model.stacks import find_stack; find_stack()", root)
    assert found.returncode == 0, found.stderr
    assert not marker.exists()


class Planted:
    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self):
        return Path.touch, (self.marker,)


@needs_modes
@pytest.mark.parametrize("opened", ["root", "file"])
def test_a_planted_kernel_is_executed_only_where_none_but_the_user_can_plant_it(root, tmp_path, opened):
    assert tiny()(3.0) == 9.0
    marker, [file] = tmp_path / "executed", cache_folder().iterdir()
    content = pickle.dumps(Planted(marker))
    file.write_bytes(kernel_cache._checksum(file, content) + content)
    with pytest.raises(TypeError):  # it is no kernel
        tiny()(3.0)
    assert marker.exists(), "the trap works"
    marker.unlink()
    (root if opened == "root" else file).chmod(0o777)
    kernel_cache._find.cache_clear()
    assert tiny()(3.0) == 9.0 and not marker.exists()


# --- damage ---------------------------------------------------------------------------------------------------------


def tiny():
    """A kernel that compiles fast, as a new process would see it."""

    @kept(numba.njit)
    def sum_of_thrice(x):
        total = 0.0
        for _ in range(3):
            total += x
        return total

    return sum_of_thrice


def run(program: str, cache: Path) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PYTHONPATH": str(PARENT), "EMAVIZ_CACHE_DIR": str(cache)}
    return subprocess.run([sys.executable, "-c", program], env=env, text=True, capture_output=True, timeout=120)


def became_folder(file: Path) -> None:
    file.unlink()
    (file / "inside").mkdir(parents=True)


def became_another(file: Path) -> None:
    """The same function's kernel for integers, whole under its own name."""
    assert tiny()(3) == 9.0
    [other] = set(file.parent.iterdir()) - {file}
    shutil.copyfile(other, file)


DAMAGES = {
    "cut": lambda file: os.truncate(file, file.stat().st_size // 2),
    "cut by a byte": lambda file: os.truncate(file, file.stat().st_size - 1),
    "cut checksum": lambda file: os.truncate(file, 7),
    "empty": lambda file: os.truncate(file, 0),
    "random": lambda file: file.write_bytes(random.Random(0).randbytes(file.stat().st_size)),
    "longer": lambda file: file.write_bytes(file.read_bytes() + b"\0"),
    "a pickle": lambda file: file.write_bytes(pickle.dumps("0.1")),
    "folder": became_folder,
    "unreadable": lambda file: file.chmod(0),
    "another kernel's": became_another,
    "gone": lambda file: file.unlink(),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_kernel_is_compiled_again(root, capsys, damage):
    assert tiny()(3.0) == 9.0
    [file] = cache_folder().iterdir()
    DAMAGES[damage](file)
    healed = tiny()
    assert healed(3.0) == 9.0
    assert len(capsys.readouterr().err.splitlines()) <= 1
    found = tiny()
    assert found(3.0) == 9.0
    assert found.stats.cache_hits and not found.stats.cache_misses, "healed for good"


def test_several_damaged_kernels_are_told_once(root, capsys):
    for _ in range(2):
        for argument in (3, 3.0, np.float32(3.0)):
            assert tiny()(argument) == 9.0
        for file in cache_folder().iterdir():
            os.truncate(file, 10)
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("emaviz: ") and "damaged" in line and "again" in line


def test_a_kernel_that_cannot_be_kept_runs(root, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kernel_cache.os, "replace", full)
    assert tiny()(3.0) == 9.0
    assert not list(cache_folder().iterdir()), "no draft is left"


PROCESS = """
import sys
import numba
from ema_model.kernel_cache import kept

@kept(numba.njit)
def sum_of_thrice(x):
    return x + x + x

print("ready", flush=True)
sys.stdin.readline()
print(sum_of_thrice(3.0))
"""


@pytest.mark.long
def test_two_processes_may_heal_the_same_kernel_at_once(root):
    env = {**os.environ, "PYTHONPATH": str(PARENT)}
    folder = cache_folder()
    for _ in range(2):
        pipes = {name: subprocess.PIPE for name in ("stdin", "stdout", "stderr")}
        both = [subprocess.Popen([sys.executable, "-c", PROCESS], env=env, text=True, **pipes) for _ in range(2)]
        for process in both:
            assert process.stdout.readline() == "ready\n"
        for process in both:
            process.stdin.write("\n")
            process.stdin.flush()
        for process in both:
            out, error = process.communicate(timeout=60)
            assert out == "9.0\n" and len(error.splitlines()) <= 1, error
        [file] = folder.iterdir()
        assert kernel_cache._read(file), "whole"
        os.truncate(file, file.stat().st_size - 100)


# --- fuzzing --------------------------------------------------------------------------------------------------------


def mutated(content: bytes, chance: random.Random) -> bytes:
    """Cut, a bit flipped, some bytes set at random or inserted, a part left out, or nothing but random bytes."""
    at, length = chance.randrange(len(content)), chance.randint(1, 64)
    kinds = (
        content[:at],
        content[:at] + bytes([content[at] ^ (1 << chance.randrange(8))]) + content[at + 1 :],
        content[:at] + chance.randbytes(length) + content[at + length :],
        content[:at] + chance.randbytes(length) + content[at:],
        content[:at] + content[at + length :],
        chance.randbytes(length),
    )
    return chance.choice(kinds)


def fuzz(count: int) -> int:
    """Mutates the kept kernel that often; returns how often it was compiled again."""
    chance, healed = random.Random(count), 0
    assert tiny()(3.0) == 9.0
    [file] = cache_folder().iterdir()
    for _ in range(count):
        content = file.read_bytes()
        changed = mutated(content, chance)
        file.write_bytes(changed)
        kernel = tiny()
        assert kernel(3.0) == 9.0
        assert bool(kernel.stats.cache_misses) == (changed != content)
        healed += bool(kernel.stats.cache_misses)
        assert list(cache_folder().iterdir()) == [file]
    return healed


def test_a_mutated_kernel_gives_the_right_number(root):
    assert fuzz(12) == 12


@pytest.mark.study
def test_a_kernel_mutated_a_thousand_times_gives_the_right_number(root):
    print(f"\n{fuzz(1000)} of 1000 mutations were found and compiled again")


# --- what is removed ------------------------------------------------------------------------------------------------


def test_drafts_of_killed_processes_go_after_a_day(root):
    folder = made(root)
    old, old_folder, new = (folder / f".draft{name}" for name in ("old", "folder", "new"))
    old.touch()
    new.touch()
    (old_folder / "inside").mkdir(parents=True)
    (folder / "kernel.nbc").touch()
    for path in (old, old_folder, folder / "kernel.nbc"):
        os.utime(path, (time.time() - 90_000.0,) * 2)
    cache_folder()
    assert sorted(folder.iterdir()) == [new, folder / "kernel.nbc"]


def test_old_versions_go_but_a_few(root):
    versions = made(root).parent
    for age in range(1, 10):
        (versions / f"{age}").mkdir()
        os.utime(versions / f"{age}", (time.time() - age * 43_000.0,) * 2)
    folder = cache_folder()
    assert {path.name for path in versions.iterdir()} == {folder.name, *"123456"}
