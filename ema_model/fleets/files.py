"""A fleet as a folder: UNIT/RECORDING.parquet, the actuator's file, and what differs, packed so that none reads it.

Nothing that compares units may read the truth.
"""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from pathlib import Path

from ema_model.actuator import save_actuator
from ema_model.errors import InputError
from ema_model.files.refusal import shown
from ema_model.files.whole_file import whole_file
from ema_model.fleets.fleet import Fleet
from ema_model.fleets.recorded import UNSEEN, recorded
from ema_model.recordings import write_measurement

TRUTH, ACTUATOR = "truth.sealed", "actuator.toml"
_MOST_BYTES = 100_000


def write(fleet: Fleet, folder: Path) -> None:
    """Into a folder that must be empty, or is made; InputError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise InputError(f"{shown(folder)}: is not empty; name another folder")
        for name in fleet.names:
            (folder / name).mkdir()
    except OSError as error:
        raise InputError(f"{shown(folder)}: cannot be made ({error.strerror}); name another folder") from None
    save_actuator(fleet.actuator, folder / ACTUATOR)
    for number, name in enumerate(fleet.names):
        for run, one in recorded(fleet.unit(number), fleet.seed, number, (*fleet.runs, *UNSEEN)).items():
            write_measurement(one, folder / name / f"{run}.parquet")
    with whole_file(folder / TRUTH) as draft:
        draft.write_bytes(base64.b64encode(zlib.compress(json.dumps(told(fleet)).encode(), 9)))


def told(fleet: Fleet) -> list[dict[str, object]]:
    """What differs, in plain values: units by name, the parameter, by how much of the file's value."""
    found = []
    for one in fleet.differences:
        value, sigma = fleet.actuator.value(one.parameter), fleet.actuator.tolerances[one.parameter].sigma
        share = one.change * sigma / value if value else None
        units = [fleet.names[i] for i in one.units]
        found.append({"units": units, "parameter": one.parameter, "change": one.change * sigma, "share": share})
    return found


def read_truth(folder: Path) -> list[dict[str, object]]:
    """What `told` said when the folder was written; InputError for one that has none."""
    try:
        unpacking = zlib.decompressobj()
        text = unpacking.decompress(base64.b64decode((folder / TRUTH).read_bytes(), validate=True), _MOST_BYTES)
        return list(json.loads(text))
    except (OSError, binascii.Error, zlib.error, ValueError, RecursionError):
        raise InputError(f"{shown(folder / TRUTH)}: no truth of a fleet can be read there; name its folder") from None
