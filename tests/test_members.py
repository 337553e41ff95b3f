"""Adding a member of a family is adding one file, a new analysis is four: a copy of the program with these, no more."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from emaviz.cli import main

PROJECT = Path(__file__).parents[1]
NEW = {
    "ema_model/effects/seal_drag.py": '''
"""Seal drag: a viscous torque of the user's seal."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, drag):
    """− τ² c ω, added."""
    return torque - gear * gear * drag * omega


EFFECT = Effect(
    title="Seal drag",
    equation="T = − τ² c ω",
    source="a test",
    explanation="The user's seal drags.",
    parameters=(
        Parameter("drag_Nms_rad", "drag c", 100.0, 0.0, 1e6, side=USER, linear=(1e3, 0.0, 1e9)),
    ),
    severities=(50.0, 100.0, 200.0),
    places=(shaft_torque,),
    shows="in the current, with the speed",
    against="motor_speed",
    mistaken_for="viscous friction",
    family="mechanics",
)
''',
    "ema_model/commands/square.py": '''
"""Square command."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.commands.command import Array, Command


@dataclass(frozen=True)
class Square(Command):
    """Back and forth between two places."""

    name = "square"
    title = "Square"
    amplitude_rad: float = 1e-3
    frequency_Hz: float = 5.0

    def at(self, time_s: Array) -> Array:
        return self.amplitude_rad * np.sign(np.sin(2.0 * np.pi * self.frequency_Hz * time_s))
''',
    "ema_model/recordings/formats/rows.py": '''
"""Rows of JSON: names first."""

from __future__ import annotations

import json

import numpy as np

from ema_model.recordings.formats.format import Columns, Format


def _header(path, max_bytes):
    return json.loads(open(path).readline())


def _read(path, names, max_bytes, strict):
    with open(path) as file:
        known, *rows = [json.loads(line) for line in file]
    table = np.array(rows, dtype=float).T
    return Columns({name: table[known.index(name)] for name in names}, lambda i: f"line {i + 2}")


FORMAT = Format(".rows", "JSON rows", _header, _read)
''',
    "ema_model/identification/optimisers/lottery.py": '''
"""Draws at random."""

from __future__ import annotations

from ema_model.identification.optimisers.sparrow_search import SparrowSearch


class Lottery(SparrowSearch):
    """As the sparrows, under another name."""

    name = "lottery"
''',
    "emaviz/cli/verbs/hello.py": '''
"""`emaviz hello`."""

HELP = "say hello"
PLACE = 99


def add_arguments(parser):
    parser.add_argument("--loud", action="store_true")


def run(arguments):
    print("HELLO" if arguments.loud else "hello")
    return 0
''',
    "emaviz/page/notes.py": '''
"""The Notes tab."""

from __future__ import annotations

import viser

from emaviz.page.tab import Shared, Tab
from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("notes", "Notes", viser.Icon.NOTE, 99)


class NotesTab(Tab):
    """Words on both sides."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        with right.add_tab("Notes", viser.Icon.NOTE):
            self.text = self.page.server.gui.add_markdown("What was seen.")

    def build(self) -> None:
        self.note = self.page.server.gui.add_text("Note", "")
''',
}
ANALYSIS = {
    "ema_model/analyses/levels.py": '''
"""Levels: the rms of a signal in each recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.result import Result

TITLE = "Levels"
HELP = "show how large a signal is"
PLACE = 98
OPTIONS = {
    "signal": {"title": "Signal", "help": "of which", "choices": {"current_A": "Current", "command_rad": "Command"}}
}


@dataclass(frozen=True, eq=False, repr=False)
class Levels(Result):
    """The rms of a signal in each recording."""

    names: Annotated[tuple[str, ...], Meta(description="of the recordings")]
    rms: Annotated[NDArray[np.float64], Meta(description="in the signal's unit")]

    @property
    def answer(self) -> Annotated[tuple[str, ...], Meta(description="in sentences")]:
        return tuple(self.lines)


RESULT = Levels


def analyse(recordings, actuator, *, signal="current_A", on_progress=None):
    rms = [np.sqrt(np.mean(one[signal] ** 2)) for one in recordings]
    return Levels(tuple(one.name for one in recordings), np.array(rms))
''',
    "ema_model/analyses/levels_words.py": '''
"""What levels say."""

from __future__ import annotations

from ema_model.text import Document, Lines


def headline(result):
    return f"The largest level is {result.rms.max():.3g}"


def document_of(result):
    return Document([Lines([headline(result)])])
''',
    "emaviz/views/levels.py": '''
"""Levels as a line over the recordings."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.analyses.levels import Levels
from ema_model.analyses.levels_words import headline
from emaviz.views import ANSWER, Figures, Section, View


def _drawn(result):
    x = list(range(1, len(result.rms) + 1))
    return [[go.Figure(go.Scatter(x=x, y=result.rms, line={"color": "#2f6fde"}), layout={"title": {"text": "rms"}})]]


VIEW = View(
    of=Levels,
    name="levels",
    title=headline,
    lead=lambda result: ", ".join(result.names),
    sections=(ANSWER, Section("Levels", "levels", (Figures(_drawn),))),
    meaning=lambda result: "good",
    columns=lambda result: {"recording": result.names, "rms": result.rms},
)
''',
    "emaviz/page/levels.py": '''
"""The Levels tab."""

from __future__ import annotations

import viser

from emaviz.page.analysis_tab import AnalysisTab
from emaviz.page.workspaces import Workspace

WORKSPACE = Workspace("levels", "Levels", viser.Icon.RULER, 98)


class LevelsTab(AnalysisTab):
    """Of Compare's recordings."""

    workspace = WORKSPACE
    analysis = "levels"
    about = "How large a signal is."
    steps = ("Press Levels.",)
''',
}
SHOWN = """
import json
import ema_model as em
found = em.analyse("levels", ["run.csv", "run.csv"], signal="command_rad")
print(found, len(found.figures()), "The largest" in found._repr_html_(), sorted(found.to_dict()))
found.export("levels.csv")
print(open("levels.csv").read().count("run"))
print([key for key in json.load(open("l.json")) if key in ("names", "rms", "answer")])
from emaviz.cli import main
main(["schema", "levels"])
"""
PAGE = """
from pathlib import Path
from emaviz.page.app import App
app = App("127.0.0.1", 0, Path("data"))
print([kind.workspace.title for kind in app.shared.tabs])
app.close()
"""
LISTS = """
from ema_model.identification.optimisers import OPTIMISERS
from ema_model.recordings.formats import FORMATS
print(OPTIMISERS["lottery"].name, ".rows" in FORMATS)
"""


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """Runs this program's copy with the new files, in a folder of its own; gives what it has said."""
    folder = tmp_path_factory.mktemp("members")
    for package in ("ema_model", "emaviz"):
        shutil.copytree(PROJECT / package, folder / package)
    for path, text in (NEW | ANALYSIS).items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text.lstrip())
    (folder / "assets").symlink_to(PROJECT / "assets")
    (folder / "data").mkdir()

    def run(*arguments: str) -> str:
        environment = {**os.environ, "PYTHONPATH": str(folder), "EMAVIZ_CACHE_DIR": str(folder / "cache")}
        environment["EMAVIZ_COMPILE_AHEAD"] = "0"
        done = subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run.folder = folder
    return run


def test_a_verb(copied):
    assert copied("-m", "emaviz", "hello", "--loud") == "HELLO\n"
    assert "say hello" in copied("-m", "emaviz", "--help")


def test_an_effect_with_a_parameter_at_the_user(copied):
    assert "N·s/m" in copied("-m", "emaviz", "effects", "seal_drag"), "on a linear axis it is converted"


@pytest.mark.long
def test_an_effect_acts_on_both_kinds_of_axes(copied):
    common = ("-m", "emaviz", "simulate", "--duration", "0.1", "--model", "mm")
    for actuator, drag in (("thesis", "drag_Nms_rad=4e4"), ("ball_screw", "drag_Ns_m=2e3")):
        chosen = (*common, "--actuator", f"assets/actuators/{actuator}.toml")
        copied(*chosen, "--out", "bare.csv")
        copied(*chosen, "--out", "drag.csv", "--effect", f"seal_drag:{drag}")
        assert (copied.folder / "bare.csv").read_text() != (copied.folder / "drag.csv").read_text()
        for name in ("bare.csv", "drag.csv"):
            (copied.folder / name).unlink()


@pytest.mark.long
def test_a_command_and_a_format(copied):
    copied("-m", "emaviz", "simulate", "--command", "square", "--duration", "0.2", "--model", "mm", "--out", "wave.csv")
    header, *rows = (copied.folder / "wave.csv").read_text().splitlines()
    lines = [json.dumps(header.split(",")), *(json.dumps([float(cell) for cell in row.split(",")]) for row in rows)]
    (copied.folder / "run.rows").write_text("\n".join(lines))
    copied("-m", "emaviz", "compare", "run.rows", "--no-calibrate", "--json", "found.json")
    assert json.loads((copied.folder / "found.json").read_text())["signals"], "what was written so is read"


def test_an_optimiser(copied):
    assert copied("-c", LISTS) == "lottery True\n"


@pytest.mark.long
def test_a_tab(copied):
    assert copied("-c", PAGE).count("'Runs', 'Levels', 'Notes']") == 1


def test_an_analysis_is_four_files(copied):
    """Verb, help, schema, JSON, report, recording, table and the form in a notebook follow by themselves."""
    assert len(ANALYSIS) == 4
    assert main(["simulate", "--model", "mm", "--duration", "0.1", "--out", str(copied.folder / "run.csv")]) == 0
    told = copied("-m", "emaviz", "levels", "run.csv", "--json", "l.json", "--report", "l.html", "--record", "l.rrd")
    assert told.startswith("The largest level is ")
    assert "<h2>Levels</h2>" in (copied.folder / "l.html").read_text()
    assert (copied.folder / "l.rrd").stat().st_size > 1000
    assert "show how large a signal is" in copied("-m", "emaviz", "--help")
    said, rows, keys, *schema = copied("-c", SHOWN).splitlines()
    assert "in the signal's unit" in "".join(schema)
    assert said.startswith("The largest level is ") and said.endswith("1 True ['answer', 'names', 'rms']")
    assert (rows, keys) == ("2", "['names', 'rms', 'answer']")
