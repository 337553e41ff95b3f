"""What a challenge gives away, and the one file that it is handed on as."""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import re
import secrets
import tempfile
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ema_model.errors import InputError, quoted
from ema_model.files.opened import (
    CHALLENGE_BYTES,
    Damaged,
    Refused,
    check_user_file,
    megabytes,
    opened_zip,
    shipped_folder,
    shown,
)
from ema_model.files.written import whole_file

# --- a challenge as one file to hand on -------------------------------------------------------------------------------
# A challenge as one file to hand on: NAME.challenge, a zip of its recordings, its story, its actuator, its seal.
#
# The seal is a digest over all other parts and a salt: a part that was changed is noticed, and what is hidden cannot
# be guessed from it. The part that tells the answer is carried here unread.

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
