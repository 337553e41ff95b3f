"""Challenges: what is hidden, sealed, and made."""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import json
import os
import re
import secrets
import tempfile
import tomllib
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ema_model.actuator import Actuator, load_actuator, save_actuator
from ema_model.commands import command
from ema_model.effects import find
from ema_model.effects.user import user_torque
from ema_model.errors import InputError, quoted
from ema_model.estimation import default_free
from ema_model.faults import vector
from ema_model.files.limits import CHALLENGE_BYTES, megabytes
from ema_model.files.opened import Damaged, Refused, check_user_file, opened_zip, shown
from ema_model.files.shipped import shipped_folder
from ema_model.files.written import whole_file
from ema_model.recordings import Measurement
from ema_model.simulation.run import Effects, Run, Sensors, simulate_reference

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


# --- seals a challenge, and tells the answer of a sealed one.  Nothing that looks for effects may read this -----------

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


# --- a challenge as one file to hand on: NAME.challenge, a zip of its recordings, its story, its actuator, it---

SUFFIX = ".challenge"
SCHEMA = 1
HIDDEN = "hidden"
MOST_CHARACTERS = {"title": 80, "story": 4000}
_HEAD, _ACTUATOR, _SEAL = "challenge.json", "actuator.toml", "seal.json"
_RECORDING = re.compile(r"[a-z0-9_]{1,30}\.parquet")
_MOST_PARTS = 12
_SALT_BYTES = 16
_REFUSED = (OSError, Damaged, KeyError, TypeError, ValueError, AttributeError, RecursionError, OverflowError)


def write_sealed(path: Path, head: Mapping[str, Any], parts: Mapping[str, bytes]) -> None:
    """Writes the file whole or not at all; InputError where it cannot be written.

    head: title, grade, story, training, holdout; parts: the recordings by name, `HIDDEN` and the actuator's file.
    """
    parts = {**parts, _HEAD: json.dumps({"schema": SCHEMA, **head}, indent=1).encode()}
    salt = secrets.token_hex(_SALT_BYTES)
    seal = {"salt": salt, "sha256": _digest(salt, parts)}
    try:
        with whole_file(path) as draft, zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in (*parts.items(), (_SEAL, json.dumps(seal).encode())):
                archive.writestr(name, content)
    except OSError as error:
        raise InputError(f"{path.name}: cannot be written ({error.strerror}); check the disk") from None


def sealed_challenge(path: Path) -> Challenge:
    """What a sealed file gives away; InputError, one line, for one that is broken, changed or none at all."""
    return _challenge(path, read_parts(path))


@contextmanager
def opened(one: Challenge) -> Iterator[Challenge]:
    """The challenge with its recordings and its actuator as files, which for a sealed one are gone afterwards."""
    if one.sealed is None:
        yield one
        return
    parts = read_parts(one.sealed)
    known = _challenge(one.sealed, parts)
    with tempfile.TemporaryDirectory(prefix="emaviz-challenge-") as name:
        folder = Path(name)
        for file in (*known.training, *known.holdout, Path(_ACTUATOR)):
            (folder / file.name).write_bytes(parts[file.name])
        training, holdout = (tuple(folder / file for file in files) for files in (known.training, known.holdout))
        try:
            yield replace(known, training=training, holdout=holdout, actuator=folder / _ACTUATOR)
        except InputError as error:  # it names a folder that will be gone
            raise InputError(f"{shown(one.sealed.name)}: {str(error).replace(f'{name}{os.sep}', '')}") from None


def read_parts(path: Path) -> dict[str, bytes]:
    """All parts but the seal, which was found whole, by their names; InputError otherwise."""
    check_user_file(path, "a sealed challenge", name=path.name)
    try:
        if path.stat().st_size > CHALLENGE_BYTES:
            raise InputError(f"{shown(path.name)}: is too large to be a challenge ({megabytes(path.stat().st_size)})")
        parts = _unpacked(path)
        seal = json.loads(parts.pop(_SEAL))
        good = hmac.compare_digest(_digest(str(seal["salt"]), parts).encode(), str(seal["sha256"]).encode())
    except InputError:
        raise
    except Refused as error:
        raise InputError(f"{shown(path.name)}: {error}; ask for it anew") from None
    except _REFUSED as error:
        raise InputError(_none(path, type(error).__name__)) from None
    if not good:
        raise InputError(f"{shown(path.name)}: was changed after it was sealed; ask for it anew")
    return parts


def _unpacked(path: Path) -> dict[str, bytes]:
    """The parts of the zip; only names that a challenge has."""
    with path.open("rb") as file, opened_zip(file, _MOST_PARTS, CHALLENGE_BYTES) as archive:
        for name in archive.names:
            if name not in (_HEAD, _ACTUATOR, _SEAL, HIDDEN) and not _RECORDING.fullmatch(name):
                raise InputError(f"{shown(path.name)}: holds {shown(name)!r}, which no challenge has")
        return {name: archive.read(name) for name in archive.names}


def _challenge(path: Path, parts: Mapping[str, bytes]) -> Challenge:
    try:
        told = json.loads(parts[_HEAD])
        if told["schema"] != SCHEMA:
            raise InputError(f"{shown(path.name)}: was sealed by another version (schema {shown(told['schema'])})")
        training, holdout = (tuple(Path(str(name)) for name in told[which]) for which in ("training", "holdout"))
        title, story = (_text(told[which], most) for which, most in MOST_CHARACTERS.items())
        grade = min(max(int(told["grade"]), 0), 5)
        found = Challenge(path.stem, title, grade, story, training, holdout, sealed=path)
    except InputError:
        raise
    except _REFUSED as error:
        raise InputError(_none(path, type(error).__name__)) from None
    if _ACTUATOR not in parts or HIDDEN not in parts or not found.training:
        raise InputError(_none(path, "a part is missing"))
    for file in (*found.training, *found.holdout):
        if str(file) not in parts or not _RECORDING.fullmatch(str(file)):
            raise InputError(f"{shown(path.name)}: its recording {shown(file)} is missing; ask for it anew")
    return found


def _digest(salt: str, parts: Mapping[str, bytes]) -> str:
    whole = hashlib.sha256(salt.encode())
    for name, content in sorted(parts.items()):
        whole.update(f"\0{name}\0{len(content)}\0".encode())
        whole.update(content)
    return whole.hexdigest()


def _text(value: Any, most: int) -> str:
    return "".join(c for c in str(value)[:most] if c.isprintable() or c == "\n").strip()


def _none(path: Path, why: str) -> str:
    return f"{shown(path.name)}: is no challenge, or damaged ({why}); ask for it anew"


# --- what a challenge gives away: its title, its story and its recordings ---------------------------------------------

FILE = "challenge.toml"
EFFECTS = "effects"  # what is hidden: physics; the other kinds are `ema_model.practice`'s


@dataclass(frozen=True)
class Challenge:
    """Recordings of actuators that are the thesis's but for tolerances, and for what may be hidden."""

    name: str  # of its folder
    title: str
    grade: int  # 1, easy, to 5
    story: str
    training: tuple[Path, ...]  # to fit
    holdout: tuple[Path, ...]  # not to fit; must improve as well
    actuator: Path | None = None  # its file; the thesis's without one
    kind: str = EFFECTS
    thresholds: dict[str, float] = field(default_factory=dict)  # of k, where its life ends
    sealed: Path | None = None  # the file that holds all of these, which then are names in it: see `sealed_file`


def folder() -> Path:
    """Where the challenges that come with the package are."""
    return shipped_folder("challenges")


def challenges(where: Path | None = None, kind: str | None = EFFECTS) -> list[Challenge]:
    """The challenges of a folder (the package's own without one), the easy ones first; InputError tells a mistake.

    kind: the one that is wanted; None for all.
    """
    found = [_read(path) for path in sorted((where or folder()).glob(f"*/{FILE}"))]
    return sorted((one for one in found if kind in (None, one.kind)), key=lambda one: (one.grade, one.name))


def _read(path: Path) -> Challenge:
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
        kind = str(told.get("kind", EFFECTS))
        given = [told[which] if kind == EFFECTS else [] for which in ("training", "holdout")]
        training, holdout = (tuple(path.with_name(str(n)) for n in names) for names in given)
        title, grade, story = str(told["title"]), int(told["grade"]), str(told["story"]).strip()
        thresholds = {str(name): float(value) for name, value in told.get("thresholds", {}).items()}
        found = Challenge(path.parent.name, title, grade, story, training, holdout, kind=kind, thresholds=thresholds)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{quoted(path)}: not a challenge: {quoted(error)}; mend it or remove its folder") from None
    except KeyError as error:
        raise InputError(f"{quoted(path)}: {error.args[0]} is missing; add it") from None
    missing = [file.name for file in (*found.training, *found.holdout) if not file.is_file()]
    if missing:
        raise InputError(
            f"{quoted(path)}: there is no {quoted(missing[0])} beside it; run python -m ema_model.challenges"
        )
    return found


# --- makes a challenge's recordings: the three-phase model with what is hidden, off within its tolerances, wi---

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
