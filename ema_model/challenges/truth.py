"""What a challenge hides, how it is sealed and made.  Nothing that looks for effects may read this."""

from __future__ import annotations

import base64
import binascii
import json
import tempfile
import tomllib
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ema_model.actuator import Actuator, load_actuator, save_actuator
from ema_model.challenges.challenge import HIDDEN, MOST_CHARACTERS, SUFFIX, read_parts, write_sealed
from ema_model.commands import command
from ema_model.effects import find
from ema_model.effects.user import user_torque
from ema_model.errors import InputError, quoted
from ema_model.estimation import default_free
from ema_model.faults import vector
from ema_model.files.opened import shown
from ema_model.recordings import Measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Effects, Run, simulate_reference

SENSORS = Sensors(current_noise_A=0.45, encoder_bits=12)

KIND = "kind"  # in the truth of a challenge of another kind than effects, which `ema_model.practice` reads
_KEYS = {"schema", "seed", "answer", "torque", "torque_parameters", "effects", "faults"}


@dataclass(frozen=True)
class Truth:
    """The plant behind a challenge's recordings."""

    name: str
    seed: int  # of the plant's parameters, and of the sensors' noise
    answer: str  # in words, for when the student is done
    effects: dict[str, dict[str, float]] = field(default_factory=dict)  # of the catalogue, with their settings
    torque: str = ""  # outside the catalogue: an expression of `ema_model.effects.user`, N·m at the motor
    torque_parameters: dict[str, float] = field(default_factory=dict)
    faults: dict[str, float] = field(default_factory=dict)  # k1 … k8 that are not healthy

    @property
    def k(self) -> NDArray[np.float64]:
        """All faults of the plant, (8,)."""
        return vector(self.faults)


def truths(where: Path) -> list[Truth]:
    """The truths of a folder of challenges of effects, by name; InputError tells a mistake."""
    found = {path: read_toml(path) for path in sorted((where / "truth").glob("*.toml"))}
    return [truth_of(told, path.stem, str(path)) for path, told in found.items() if KIND not in told]


def read_truth(path: Path) -> Truth:
    """One truth; InputError tells a mistake."""
    return truth_of(read_toml(path), path.stem, str(path))


def read_toml(path: Path) -> dict[str, Any]:
    """The text of a truth of any kind; InputError for what is none."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{quoted(path)}: not a challenge's truth: {quoted(error)}") from None


def truth_of(told: Mapping[str, Any], name: str, where: str) -> Truth:
    """The truth that a file tells; InputError, which begins with `where`, tells a mistake."""
    if unknown := told.keys() - _KEYS:
        raise InputError(f"{where}: {quoted(min(unknown))} is not known; known are {', '.join(sorted(_KEYS))}")
    try:
        effects = {effect: find(effect).settings(dict(given)) for effect, given in told.get("effects", {}).items()}
        faults = {fault: float(value) for fault, value in told.get("faults", {}).items()}
        vector(faults)
        return Truth(
            name,
            int(told["seed"]),
            str(told["answer"]).strip(),
            effects,
            str(told.get("torque", "")),
            {parameter: float(value) for parameter, value in told.get("torque_parameters", {}).items()},
            faults,
        )
    except KeyError as error:
        raise InputError(f"{where}: {error.args[0]} is missing; add it") from None
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f"{where}: not a challenge's truth: {quoted(error)}") from None


# --- seals a challenge, and tells the answer of a sealed one ----------------------------------------------------------
# Nothing that looks for effects may read this.
#
# The answer is packed so that nobody reads it by a glance into the file; who wants to cheat can.

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


# --- makes a challenge's recordings -----------------------------------------------------------------------------------
# Makes a challenge's recordings: the three-phase model with what is hidden, off within its tolerances, with noise.
#
# The same truth gives the same values: all that is drawn comes from its seed.

RUNS = {
    "chirp": Run(command("chirp"), 0.5),
    "step": Run(command("step", {"final_rad": 0.005}), 0.5),
    "sine": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 1.0),
    "unseen": Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5.0}), 0.5),
}
COLUMNS = ("time_s", "command_rad", "user_position_rad", "motor_position_rad", "current_A")
_CONVERTER_STEP_A = 2.0**-7  # a 12-bit converter over ±16 A
_COMMAND_STEP_RAD = 2.0**-30
_WORST = 2.0  # σ that a parameter is off, at most
_RANGE = (-100.0, 100.0)  # of a hidden torque's parameters


def make(truth: Truth, where: Path) -> None:
    """Writes the challenge's recordings to the folder of its name, which must be there."""
    for name, recording in recorded(truth, load_actuator()):
        write(recording, where / truth.name / f"{name}.parquet")


def recorded(
    truth: Truth, actuator: Actuator, sensors: Sensors = SENSORS, load_torque_Nm: float = 0.0
) -> Iterator[tuple[str, Measurement]]:
    """The names and recordings of `RUNS`, one after another, under a constant load at the user.

    Raises InputError for an actuator that has no three-phase model, FloatingPointError if that one diverges.
    """
    plant, effects = plant_of(truth, actuator), _hidden(truth)
    for number, (name, run) in enumerate(RUNS.items()):
        loaded = replace(run, load_torque_Nm=load_torque_Nm)
        recording = simulate_reference(loaded, plant, truth.k, effects)
        yield name, sensors.record(recording, 1000 * truth.seed + number)


def plant_of(truth: Truth, actuator: Actuator) -> Actuator:
    """The actuator with each free parameter somewhere within its tolerance."""
    random = np.random.default_rng(truth.seed)
    drawn = {}
    for path in default_free(actuator):
        if not path.startswith("sensors."):
            off = float(np.clip(random.standard_normal(), -_WORST, _WORST))
            drawn[path] = actuator.value(path) + off * actuator.tolerances[path].sigma
    return actuator.with_values(drawn)


def _hidden(truth: Truth) -> Effects:
    if not truth.torque:
        return truth.effects
    own = user_torque(truth.torque, dict.fromkeys(truth.torque_parameters, _RANGE))
    return {**truth.effects, own.name: truth.torque_parameters}


def write(recording: Measurement, path: Path) -> None:
    """Small: what a converter would give has few digits, and bytes of a kind stand together.

    The load is written where there is one: whoever solves the challenge knows of it.
    """
    digits = {"current_A": _CONVERTER_STEP_A, "command_rad": _COMMAND_STEP_RAD}
    columns = {}
    for name in (*COLUMNS, "load_torque_Nm") if "load_torque_Nm" in recording else COLUMNS:
        step = digits.get(name)
        values = recording[name] if step is None else step * np.round(recording[name] / step)
        columns[name] = pa.array(values)
    pq.write_table(
        pa.table(columns).replace_schema_metadata({"emaviz_schema": "1"}),
        path,
        compression="zstd",
        compression_level=19,
        # The stubs know a bool only; columns by name are documented.
        use_dictionary=["user_position_rad", "motor_position_rad", "current_A"],  # pyright: ignore[reportArgumentType]
        column_encoding=dict.fromkeys(("time_s", "command_rad"), "BYTE_STREAM_SPLIT"),
    )
