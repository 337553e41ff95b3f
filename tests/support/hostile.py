"""A data folder in which every name tries to become part of the page."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from ema_model.actuator import load_actuator, save_actuator
from ema_model.challenges.challenge import HIDDEN, write_sealed
from ema_model.commands import command
from ema_model.recordings import write_measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference
from emaviz.recording import RecordingWriter
from emaviz.session.data_folder import DataFolder

# A file's name has no slash, so the script ends in an entity.
FRAME = '<iframe srcdoc="<script>parent.hit=1<&#47;script>">'
IMAGE = "<img src=x onerror=parent.hit=1>"
MARKDOWN = "**b**[l](javascript:hit=1)![](http:x)`c`"
NAMES = (FRAME, IMAGE, MARKDOWN)


def folder(at: Path) -> DataFolder:
    """Recordings of a rig, of searches whole and interrupted, an actuator, a challenge, and a session that is none."""
    data = DataFolder(at)
    run = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.4)
    recording = Sensors(0.2, encoder_bits=12).record(simulate_reference(run, load_actuator()), seed=1)
    for name in NAMES:
        write_measurement(recording, data.uploads / f"{name}.csv")
        _with_columns(data.uploads / f"{name}.csv", data.uploads / f"columns {name}.csv", name)
        (data.uploads / f"broken {name}.csv").write_text(f"time_s,{name}\n0,{name}\n")
    actuator = replace(load_actuator(), name=FRAME)
    save_actuator(actuator, data.actuators / f"{MARKDOWN}.toml")
    (data.sessions / f"{FRAME}.emaviz").write_text("none")
    _challenge(data, recording)
    _searches(data)
    return data


def _with_columns(source: Path, target: Path, name: str) -> None:
    """A rig's own names of the columns, and one that nobody can know."""
    head, *rows = source.read_text().splitlines()
    names = [f"{column} {i}" for i, column in enumerate(head.split(","))]
    quoted = '"' + f"{name} of a column".replace('"', '""') + '"'
    target.write_text("\n".join([",".join([*names, quoted]), *(f"{row},{i % 7}" for i, row in enumerate(rows))]))


def _challenge(data: DataFolder, recording) -> None:
    part, actuator = data.folder / "run.parquet", data.folder / "actuator.toml"
    write_measurement(recording, part)
    save_actuator(load_actuator(), actuator)
    head = {"title": IMAGE, "grade": 1, "story": f"{FRAME} {MARKDOWN}", "training": ["run.parquet"], "holdout": []}
    parts = {HIDDEN: b"-", "run.parquet": part.read_bytes(), "actuator.toml": actuator.read_bytes()}
    write_sealed(data.challenges / f"{IMAGE}.challenge", head, parts)
    part.unlink()
    actuator.unlink()


def _searches(data: DataFolder) -> None:
    """Two that say hostile things of themselves, one that was interrupted, and one that cannot be recovered."""
    for name in NAMES:
        path = data.recordings / f"{name}.rrd"
        answer = {"rmse_A": 1.0, "elapsed_s": 1.0, "evaluations": 1, "k": [1.0] * 8, "alarms": NAMES, "healthy": False}
        said = {"settings": {name: name, "algorithms": name}, "found": {name: answer, "do": answer}, "best": name}
        with RecordingWriter(path) as writer:
            writer.properties(said)
            writer.signals("monitor", np.arange(20) / 10.0, {"current_A": np.arange(20.0)})
    shutil.copyfile(path, data.recordings / f"whole {FRAME}.rrd.part")
    (data.recordings / f"damaged {FRAME}.rrd.part").write_bytes(b"RRF2 and then nonsense")
