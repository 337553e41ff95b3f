"""Seals a challenge, and tells the answer of a sealed one.  Nothing that looks for effects may read this.

The answer is packed so that nobody reads it by a glance into the file; who wants to cheat can.
"""

from __future__ import annotations

import base64
import binascii
import json
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

from ema_model.actuator import Actuator, save_actuator
from ema_model.challenges.make import RUNS, SENSORS, recorded, write
from ema_model.challenges.sealed_file import HIDDEN, MOST_CHARACTERS, SUFFIX, read_parts, write_sealed
from ema_model.challenges.truth import Truth, truth_of
from ema_model.errors import InputError, quoted
from ema_model.files.refusal import shown
from ema_model.simulation.sensors import Sensors

_HELD_OUT = "unseen"
_GRADE = 0  # nobody has judged how hard it is
_MOST_BYTES = 100_000


def seal(
    truth: Truth,
    path: Path,
    title: str,
    story: str,
    actuator: Actuator,
    *,
    sensors: Sensors = SENSORS,
    load_torque_Nm: float = 0.0,
    on_progress: Callable[[str], None] = lambda text: None,
) -> None:
    """Makes the standard recordings of a plant, one of them to hold out, and seals them with the truth in one file.

    actuator: as its file has it; the plant is off within the tolerances, as the truth's seed draws it.
    Raises InputError for texts that are missing or too long, for a plant that cannot be simulated, and where the file
    cannot be written.
    """
    if path.suffix != SUFFIX:
        raise InputError(f"{quoted(path.name)}: the name of a sealed challenge must end in {SUFFIX}")
    for (name, most), text in zip(MOST_CHARACTERS.items(), (title, story)):
        if not text.strip() or len(text) > most:
            raise InputError(f"the challenge needs a {name} of up to {most} characters; it has {len(text.strip())}")
    parts = {HIDDEN: _packed(truth)}
    with tempfile.TemporaryDirectory(prefix="emaviz-sealing-") as name:
        folder = Path(name)
        # The faults that are known are hidden, too, and so is what somebody has noted in the file.
        save_actuator(replace(actuator, faults={}, text=""), folder / "actuator.toml")
        try:
            for i, (run, recording) in enumerate(recorded(truth, actuator, sensors, load_torque_Nm), 1):
                on_progress(f"recorded {i} of {len(RUNS)}")
                write(recording, folder / f"{run}.parquet")
        except FloatingPointError as error:
            raise InputError(f"this plant cannot be recorded: {error}; make what is hidden weaker") from None
        parts |= {file.name: file.read_bytes() for file in folder.iterdir()}
    files = [f"{run}.parquet" for run in RUNS]
    held = f"{_HELD_OUT}.parquet"
    training = [file for file in files if file != held]
    head = {"title": title.strip(), "grade": _GRADE, "story": story.strip(), "training": training, "holdout": [held]}
    write_sealed(path, head, parts)


def unseal(path: Path) -> Truth:
    """What is hidden in a sealed challenge; InputError for a file that is broken or was changed."""
    where = shown(path.name)
    hidden = read_parts(path).get(HIDDEN, b"")
    try:
        packed = base64.b64decode(hidden, validate=True)
        unpacking = zlib.decompressobj()
        text = unpacking.decompress(packed, _MOST_BYTES)
        told = json.loads(text)
        if unpacking.unconsumed_tail or not isinstance(told, dict):
            raise ValueError("too much")
    except (binascii.Error, zlib.error, ValueError, RecursionError) as error:
        raise InputError(f"{where}: its answer cannot be read ({type(error).__name__}); ask for it anew") from None
    return truth_of(told, path.stem, where)


def _packed(truth: Truth) -> bytes:
    told = {name: value for name, value in asdict(truth).items() if name != "name" and value not in ("", {})}
    return base64.b64encode(zlib.compress(json.dumps(told).encode(), 9))
