"""What the README says is what happens: the app started as it is written there, and each of its command lines."""

from __future__ import annotations

import contextlib
import importlib.metadata
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.on_page import choose, field, press, wait_until

from ema_model.actuator import load_actuator
from ema_model.recordings import read
from emaviz.cli import main

ROOT = Path(__file__).parents[1]
BLOCKS = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)

SERVED = re.compile(r"https?://127\.0\.0\.1:\d+\S*")

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="runs a POSIX shell's lines")


def started(line: str, folder: Path) -> Any:
    """A shell's line in that folder, as after `activate`; what it says comes on one pipe."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.Popen(
        ["/bin/sh", "-c", line],
        cwd=folder,
        # the same kernels of OpenBLAS on every processor, by which a calibration on a flat ridge ends at the same place
        env={**os.environ, "PATH": path, "BROWSER": "true", "PYTHONUNBUFFERED": "1", "OPENBLAS_CORETYPE": "Haswell"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


# --- the app ----------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def app_of_the_readme(folder: Path) -> Iterator[str]:
    """Starts the program that ends the README's first line, with the options that stand there; its address."""
    process = started(f"exec {BLOCKS[0].split('&&')[-1].replace('.venv/bin/', '')}", folder)
    said = []
    try:
        for line in process.stdout:
            said.append(line)
            if line.startswith("first picture"):
                break
        address = SERVED.search("".join(said))
        assert address, "".join(said)
        yield address.group()
    finally:
        process.send_signal(signal.SIGINT)
        said.append(process.communicate(timeout=60)[0])
        assert "Traceback" not in "".join(said), "".join(said)


def opened(browser: Any, address: str) -> Any:
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.set_default_timeout(60_000)
    page.goto(address)
    page.get_by_role("tab", name="Explore", exact=True).wait_for()
    return page


def tab(page: Any, name: str) -> None:
    page.get_by_role("tab", name=name, exact=True).click()


def options(page: Any, label: str) -> list[str]:
    page.get_by_label(label, exact=True).click()
    page.get_by_role("option").first.wait_for()
    found = page.get_by_role("option").all_inner_texts()
    page.keyboard.press("Escape")
    return found


def files(folder: Path, kind: str) -> list[Path]:
    return [path for path in (folder / "emaviz-data" / kind).iterdir() if not path.name.startswith(".")]


@pytest.mark.browser
def test_what_was_saved_is_there_when_the_app_is_started_again_as_the_readme_does(browser, tmp_path):
    with app_of_the_readme(tmp_path) as address:
        page = opened(browser, address)
        choose(page, "Preset", "friction, low")
        press(page, "Seal as a challenge…", page.get_by_role("button", name="Seal it"))
        field(page, "Challenge title").fill("For a colleague")
        page.locator("textarea:visible").last.fill("It runs heavily.")
        page.wait_for_timeout(500)
        page.get_by_role("button", name="Seal it").click()
        page.get_by_text("Challenge sealed").wait_for()
        tab(page, "Compare")
        page.get_by_text("New actuator", exact=True).click()
        field(page, "Name").fill("Rig 2")
        press(page, "Make this actuator", page.get_by_text("is made, and chosen above"))
        wait_until(lambda: files(tmp_path, "challenges"))
        tab(page, "Identify")
        page.get_by_role("button", name="Identify", exact=True).click()
        page.get_by_role("link", name="in Rerun").wait_for(timeout=120_000)
        tab(page, "Runs")
        field(page, "Session name").fill("monday")
        page.wait_for_timeout(500)
        page.get_by_role("button", name="Save session").click()
        wait_until(lambda: files(tmp_path, "sessions"))
        page.get_by_text("Session saved").wait_for()
        runs = options(page, "Run")
        page.close()
    kinds = ("challenges", "actuators", "recordings", "sessions")
    saved = {kind: sorted(path.name for path in files(tmp_path, kind)) for kind in kinds}
    assert all(saved.values()), saved
    with app_of_the_readme(tmp_path) as address:
        page = opened(browser, address)
        tab(page, "Runs")
        assert options(page, "Run") == runs
        assert options(page, "Saved") == [f"sessions/{name}" for name in saved["sessions"]]
        press(page, "Load session", page.get_by_text("Session loaded"))
        tab(page, "Compare")
        assert any("Rig 2" in name for name in options(page, "Actuator"))
        tab(page, "Discover")
        assert any("For a colleague" in name for name in options(page, "Measurements"))
        choose(page, "Measurements", next(n for n in options(page, "Measurements") if "For a colleague" in n))
        page.close()


# --- the command lines ------------------------------------------------------------------------------------------------

# What takes seconds, or needs what such a line has written.  One that needs a short line's file has it made.
LONG = (
    "identify",
    "view",
    "motor_speed_rad_s",
    "emaviz rig.csv",
    "user_torque",
    "challenge six_siblings",
    "--by unit",
    "overhaul",
    "challenge one_life",
    "frequency sweep",
    "track",
    "campaign",
    "reproduce",
)


def lines_of(blocks: list[str]) -> list[str]:
    """The command lines without their comments, as a shell reads them."""
    lines = [line for block in blocks for line in block.splitlines()]
    return [re.sub(r"\s+# .*", "", line) for line in lines if line.strip()]


def marked(line: str) -> Any:
    long = any(text in line for text in LONG)
    return pytest.param(line, id=line[:60], marks=[pytest.mark.long] if long else [])


LINES = lines_of(BLOCKS[1:-1])  # without what installs


# What a processor's own rounding may move: a floor is how far two models part that stick and slide, and where they do
# a last digit decides; the mean of sixteen draws scatters by 1.4 %.
ROUNDED = 0.07


WRITES = ("--out", "--report", "--record", "--json", "--save-actuator")


def written_by(line: str) -> set[str]:
    """The files and folders that a line makes, relative to where it runs."""
    words = shlex.split(line)
    if words[0] == "cp":
        return {Path(words[1]).name}
    return {after for word, after in pairwise(words) if word in WRITES}


def makers_of(line: str) -> list[str]:
    """The lines above this one that write what it reads."""
    read = {word.split("/")[0] for word in shlex.split(line)} - written_by(line)
    return [one for one in LINES[: LINES.index(line)] if written_by(one) & read]


def serves(line: str) -> bool:
    """Whether the line opens a page and stays."""
    words = shlex.split(line)
    return words[0] == "emaviz" and (words[1] == "view" or Path(words[1]).suffix != "")


class Clone:
    """One folder for all lines, in the place of the clone; each is run once, when it or what it writes is asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "assets").symlink_to(ROOT / "assets")
        self._said: dict[str, str] = {}

    def run(self, line: str) -> str:
        """What a line says, which ends well; before it the lines that write what it reads."""
        for maker in makers_of(line):
            self.run(maker)
        if line not in self._said:
            self._said[line] = self._run(line)
        return self._said[line]

    def _run(self, line: str) -> str:
        process = started(f"exec {line}" if serves(line) else line, self.folder)
        said = ""
        if serves(line):
            for one in process.stdout:
                said += one
                if SERVED.search(one):
                    process.send_signal(signal.SIGINT)
                    break
            assert SERVED.search(said), said
        said += process.communicate()[0]
        assert process.returncode in ((0, 130) if serves(line) else (0,)), said
        assert "Traceback" not in said
        return said


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Clone:
    return Clone(tmp_path_factory.mktemp("clone"))


@pytest.mark.parametrize("line", [marked(line) for line in LINES])
def test_a_command_line_of_the_readme_runs_as_it_stands(line, clone):
    said = clone.run(line)
    for name in written_by(line):
        assert (clone.folder / name).exists(), f"{name} was not written"
    if shlex.split(line)[1] == "discover":
        shown = (ROOT / "README.md").read_text(encoding="utf-8").split(line)[1].split("```\n", 2)[2].split("```")[0]
        printed = dict(map(words_and_numbers, said.splitlines()))
        for words, numbers in filter(any, map(words_and_numbers, shown.splitlines())):
            assert printed[words] == pytest.approx(numbers, rel=ROUNDED), words


def words_and_numbers(line: str) -> tuple[str, list[float]]:
    """A line of text without its numbers, and those."""
    number = r"−?\d+(?:\.\d+)?"
    return re.sub(number, "#", line), [float(one.replace("−", "-")) for one in re.findall(number, line)]


def test_the_log_that_lines_are_shown_on_is_one_of_the_reference_model(tmp_path):
    made = tmp_path / "made.csv"
    law = "user_torque:expression=-c*sqrt(abs(omega))*sign(omega),c=0.003"
    run = f"simulate --effect {law} --noise-current 0.1 --encoder-bits 14 --sample-rate 2000 --seed 7 --out {made}"
    assert main(run.split()) == 0
    own = load_actuator()
    shipped = read(ROOT / "assets/examples/rig.csv", own, ["current_A=ch7[mA]", "motor_speed_rad_s=n[rpm]"])
    again = read(made, own)
    for name in ("user_position_rad", "motor_speed_rad_s", "current_A"):
        off = np.sqrt(np.mean((shipped[name] - again[name]) ** 2)) / np.std(again[name])
        assert off < 0.02, name


_WITHOUT = """
import importlib, importlib.abc, pkgutil, sys

class Absent(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in absent:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

absent = set(sys.argv[1].split(","))
sys.meta_path.insert(0, Absent())
import ema_model, emaviz
for package in (ema_model, emaviz):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.endswith("__main__") and module.name not in sys.argv[2:]:
            importlib.import_module(module.name)
"""


def test_every_module_is_there_with_what_the_readme_installs():
    """The tests' lock holds more, Dask among it: a module that needs it at its top would keep the app from starting."""

    def usual(name: str) -> str:
        return re.sub(r"[-_.]+", "-", name).lower()

    app, tests = (
        {usual(line.partition("==")[0]) for line in lock.read_text(encoding="utf-8").splitlines() if "==" in line}
        for lock in (ROOT / "lock.txt", ROOT / "tests" / "lock.txt")
    )
    absent = [
        module
        for module, owners in importlib.metadata.packages_distributions().items()
        if {usual(owner) for owner in owners} <= tests - app
    ]
    assert "distributed" in absent and "numpy" not in absent
    by_choice = ("ema_model.campaign.dask_worker",)  # what --scheduler alone imports
    line = [sys.executable, "-c", _WITHOUT, ",".join(absent), *by_choice]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
