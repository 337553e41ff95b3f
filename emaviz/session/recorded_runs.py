"""RecordedRuns runs of the data folder: what each is and came to; renamed, deleted, read back."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ema_model.analyses import analyses
from ema_model.discovery.words import effect_title
from ema_model.errors import InputError
from ema_model.files.opened import shown
from ema_model.quantities import in_sentence, number
from emaviz.recording.entry import Entry
from emaviz.session.data_folder import sanitised

if TYPE_CHECKING:
    from emaviz.recording.read import Recording


# --- what a recorded run is, in a line: its kind and what came of it, from what its file says of itself ---------------

UNKNOWN = "run"


def summary(said: Mapping[str, Any]) -> tuple[str, str]:
    """('discovery', 'cogging torque: 1.69 → 0.757 × floor'); ('run', '') of a file that says nothing."""
    for key, (kind, words) in _KINDS.items():
        if isinstance(said.get(key), Mapping):
            try:
                return kind, words(said[key])
            except (KeyError, TypeError, IndexError, ValueError):  # of another version
                return kind, ""
    return UNKNOWN, ""


def _identification(found: Mapping[str, Any]) -> str:
    names = sorted({name for one in found.values() for name in one.get("alarms", ())})
    return "not healthy: " + ", ".join(names) if names else "healthy" if _all(found, "healthy") else "no single k off"


def _all(found: Mapping[str, Any], name: str) -> bool:
    return all(one.get(name) for one in found.values())


def _discovery(found: Mapping[str, Any]) -> str:
    names = [in_sentence(effect_title(str(one["name"]))) for one in found["effects"]]
    errors = [found["ladder"][at]["rmse"] for at in (0, -1)]
    if None in errors:
        fell = ""
    elif len(found["ladder"]) > 1:
        fell = f"{number(errors[0])} → {number(errors[1])} × floor"
    else:
        fell = f"{number(errors[0])} × floor"
    what = ", ".join(names) or str(found["verdict"]).replace("_", " ")
    return f"{what}: {fell}" if fell else what


def _comparison(found: Mapping[str, Any]) -> str:
    return str(found["sentences"][0])


def _tracking(found: Mapping[str, Any]) -> str:
    trends = [name for name, one in found["faults"].items() if one.get("trend")]
    return f"trend of {', '.join(trends)}" if trends else "no trend"


_KINDS: dict[str, tuple[str, Callable[[Mapping[str, Any]], str]]] = {
    "found": ("identification", _identification),
    "discovery": ("discovery", _discovery),
    "comparison": ("comparison", _comparison),
    "track": ("tracking", _tracking),
    "reproduce": ("evaluation", lambda _: "the thesis's tables beside ours"),
    **{name: (in_sentence(one.title), lambda found: str(found["answer"][0])) for name, one in analyses().items()},
}

# --- past recordings: what the folder holds, with settings and results; renamed, deleted, read back -------------------

_ENDING = ".rrd"


class RecordedRuns:
    """The folder of recordings.  Raises InputError, one line, for what is refused.

    Only the names that the folder lists are taken; what a file says of itself is kept until the file changes.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self._known: dict[str, tuple[tuple[int, int], Entry]] = {}

    def names(self) -> list[str]:
        """Names of the recordings, the newest first."""
        found = []
        for one in os.scandir(self.folder):
            if one.name.endswith(_ENDING) and not one.name.startswith(".") and one.is_file():
                found.append((-one.stat().st_mtime_ns, one.name))
        return [name for _, name in sorted(found)]

    def entry(self, name: str) -> Entry:
        """A recording with its settings and result, as far as it says them."""
        path = self.path(name)
        try:
            status = path.stat()
        except OSError as error:
            raise InputError(f"{shown(name)}: cannot be read ({error.strerror})") from None
        version = status.st_mtime_ns, status.st_size
        known = self._known.get(name)
        if known is None or known[0] != version:
            said = _properties(path)
            at = datetime.fromtimestamp(status.st_mtime)
            known = version, Entry(name, at, status.st_size, **said)
            self._known[name] = known
        return known[1]

    def read(self, name: str) -> Recording:
        """Everything in it."""
        from emaviz.recording import read

        try:
            return read(self.path(name))
        except OSError as error:
            raise InputError(str(error)) from None

    def rename(self, name: str, wanted: Any) -> str:
        """Gives it another name, made safe, and returns that; a name that is taken is refused."""
        path = self.path(name)
        stem = str(wanted).strip().removesuffix(_ENDING)
        if not stem:
            raise InputError("a run needs a name; type one first")
        new = sanitised(stem + _ENDING)
        target = self.folder / new
        if new == name:
            return name
        if os.path.lexists(target):
            raise InputError(f"{shown(new)} exists already; choose another name")
        try:
            path.rename(target)
        except OSError as error:
            raise InputError(f"{shown(name)}: cannot be renamed ({error.strerror})") from None
        self._known.pop(name, None)
        return new

    def delete(self, name: str) -> None:
        """Removes the file."""
        try:
            self.path(name).unlink()
        except OSError as error:
            raise InputError(f"{shown(name)}: cannot be deleted ({error.strerror})") from None
        self._known.pop(name, None)

    def path(self, name: str) -> Path:
        """Where it is; refused unless the folder itself lists it."""
        path = self.folder / name
        try:
            listed = Path(name).name == name and name.endswith(_ENDING) and path.is_file() and not path.is_symlink()
        except OSError:  # longer than any name
            listed = False
        if not listed:
            raise InputError(f"{shown(name)}: no such run; choose one of the list")
        return path


def _properties(path: Path) -> dict[str, Any]:
    """What it is and came to; settings, answers and the best of an identification; nothing of damaged files."""
    try:
        from emaviz.recording.read import properties

        said = properties(path)
    except (OSError, ImportError):
        return {}
    kind, says = summary(said)
    settings, found, best = said.get("settings"), said.get("found"), said.get("best")
    if not (isinstance(settings, dict) and isinstance(found, dict) and isinstance(best, str)):
        return {"kind": kind, "says": says}
    return {"settings": settings, "found": found, "best": best, "kind": kind, "says": says}


def recovered(recordings: Path) -> list[str]:
    """What became of recordings of interrupted runs, a line each."""
    try:
        from emaviz.recording.read import recover

        return [f"Recovered a recording of an interrupted run: {found}" for found in recover(recordings)]
    except (OSError, ImportError) as error:
        return [f"Interrupted recordings cannot be recovered: {error}"]
