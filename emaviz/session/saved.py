"""A session as one file: what the page is set to and has found, with the measured files that it needs.

NAME.emaviz is a zip of `session.json` and the files under `files/`, so that it opens on another computer.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ema_model.errors import InputError
from ema_model.recordings import side_path
from ema_model.recordings.refusal import shown
from ema_model.whole_file import whole_file
from emaviz import __version__
from emaviz.session.data_folder import SESSION_SUFFIX, DataFolder, sanitised

SCHEMA = 1
MOST_BYTES = 512 * 1024 * 1024  # of all files in a session, unpacked
_MOST_JSON_BYTES = 32 * 1024 * 1024
_MOST_FILES = 200
_DOCUMENT, _FILES = "session.json", "files/"


@dataclass(frozen=True)
class Part:
    """One part of the page.

    save(): what JSON can hold; restore(saved, names): takes it, names being the files' names now by those of then.
    InputError from `restore` says what makes no sense.  files(): names in the data folder of what it needs.
    """

    save: Callable[[], Any]
    restore: Callable[[Any, Mapping[str, str]], None]
    files: Callable[[], Sequence[str]] = list


def write(path: Path, parts: Mapping[str, Part], folder: DataFolder, names: Sequence[str]) -> None:
    """Writes a session; names: measurements and actuator files of the data folder that belong to it.

    Raises InputError, and leaves nothing behind, if it cannot be written.
    """
    document = {"schema": SCHEMA, "emaviz": __version__, "files": [], **{n: p.save() for n, p in parts.items()}}
    try:
        with whole_file(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name in dict.fromkeys(names):
                file = folder.folder / name
                if not (folder.holds(file) and file.is_file()):
                    continue
                document["files"].append(name)
                archive.write(file, _FILES + name)
                side = side_path(file)
                if side != file and side.is_file() and folder.holds(side):
                    archive.write(side, _FILES + folder.name_of(side))
            archive.writestr(_DOCUMENT, json.dumps(document, indent=1))
    except OSError as error:
        raise InputError(f"{path.name}: cannot be written ({error.strerror}); check the disk") from None


def read(path: Path, parts: Mapping[str, Part], folder: DataFolder) -> None:
    """Takes a session back, its files into the data folder.  InputError: no session, damaged, too large."""
    try:
        with zipfile.ZipFile(path) as archive:
            document = _document(archive, path)
            names = _take_files(archive, document, path, folder)
    except (
        OSError,
        zipfile.BadZipFile,
        KeyError,
        UnicodeDecodeError,
        EOFError,
        NotImplementedError,
        RuntimeError,
    ) as e:
        raise InputError(f"{shown(path.name)}: is no session, or damaged ({type(e).__name__}); save it anew") from None
    for name, part in parts.items():
        if name in document:
            part.restore(document[name], names)


def _document(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    if archive.getinfo(_DOCUMENT).file_size > _MOST_JSON_BYTES:
        raise InputError(f"{shown(path.name)}: its settings are too large to be a session's")
    try:
        document = json.loads(archive.read(_DOCUMENT))
    except ValueError:
        document = None
    if not isinstance(document, dict) or not isinstance(document.get("files", []), list):
        raise InputError(f"{shown(path.name)}: is no session of emaviz")
    if document.get("schema") != SCHEMA:
        raise InputError(f"{shown(path.name)}: was saved by another version (schema {document.get('schema')!r})")
    return document


def _take_files(
    archive: zipfile.ZipFile, document: Mapping[str, Any], path: Path, folder: DataFolder
) -> dict[str, str]:
    """Unpacks what the data folder does not have already; names now by those of then."""
    inside = {info.filename: info for info in archive.infolist()}
    wanted = [str(name) for name in document.get("files", [])]
    total = sum(info.file_size for info in inside.values())
    if len(inside) > _MOST_FILES or total > MOST_BYTES:
        raise InputError(f"{shown(path.name)}: {len(inside)} files of {total / 1e6:.3g} MB are too much for a session")
    names = {}
    for name in wanted:
        info = inside.get(_FILES + name)
        if info is None:
            continue
        content = archive.read(info)
        side = inside.get(_FILES + side_path(Path(name)).as_posix())
        here = folder.folder / name
        if folder.holds(here) and here.is_file() and here.read_bytes() == content:
            names[name] = name
            continue
        kept = folder.place(sanitised(Path(name).name))
        kept.write_bytes(content)
        if side is not None and side is not info:
            side_path(kept).write_bytes(archive.read(side))
        names[name] = folder.name_of(kept)
    return names


def free_path(folder: DataFolder, wanted: Any) -> Path:
    """Where a session of that name goes; a name that is taken gets a number."""
    stem = str(wanted).strip().removesuffix(SESSION_SUFFIX) or "session"
    return folder.place(sanitised(stem + SESSION_SUFFIX))
