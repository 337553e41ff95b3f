"""The models' kernels for a stack of effects: composed, compiled and cached.

numba finds a compiled kernel again only when it stands in a file, and never notices that a function it
inlined was edited elsewhere.  So each stack — a controller, a drive and some effects — becomes a folder of its own:
the files of `ema_model.kernels` copied beside a generated `composition.py` that inlines the stack.  The
folder lies under a hash of the sources that kernels are made of and of the versions that compile them: an
edited effect is another folder, and an old kernel is never served.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from ema_model.errors import InputError
from ema_model.physics.rows import LANES, PARAMETER_ROWS

CIRCUITS = ("thesis", "reduced")  # the drives that stand for the hysteresis current loop
DRIVES = (*CIRCUITS, "current", "voltage")
CONTROLLERS = ("cascade", "position")
_PACKAGE = Path(__file__).parent
# All that a kernel may inline; `tests/model/test_stacks.py` checks that kernels import nothing else of ours.
_COMPILED = ("stacks.py", "physics/*.py", "kernels/*.py", "effects/*.py")
_KEPT_VERSIONS = 6  # folders of other hashes (older sources or versions) that are left in the cache


# Where effects can act: the arguments of each place.  The first is the value that the base model, or the
# effect before, has found there; an effect's function returns it changed.
PLACES = {
    "moving_friction": ("level", "static", "omega", "motor_torque", "load", "gear"),
    "friction": ("torque", "omega", "active", "static", "dynamic"),
    "electric_torque": ("torque", "theta", "omega", "current"),
    "shaft_torque": ("torque", "theta", "omega", "current", "user", "gear", "load"),
    "back_emf": ("emf", "omega", "current"),
    "winding_resistance": ("resistance",),
    "bus_voltage": ("volts", "current"),
    "inverse_inertia": ("inverse",),
    "user_position": ("user", "theta", "gear"),
    "position_reading": ("user",),
    "current_reading": ("current",),
}
# The arguments of an effect's `advance_states`, which returns its new states as a tuple: the step, s; angle and
# speed at its start; the rigid transmission's output before and after; how far the user moved; what acts.
ADVANCE = (
    *("dt", "theta", "omega", "rigid", "rigid_next", "user_step", "gear", "load", "active", "static", "dynamic"),
)


@dataclass(frozen=True)
class Stack:
    """A controller, a drive and effects, with the kernels compiled for them (on their first call)."""

    circuit: str  # the drive
    controller: str
    effects: tuple[str, ...]
    parameter_rows: tuple[str, ...]  # of the base model, then "effect.parameter"
    states: tuple[str, ...]  # of the effects, "effect.state", behind the base model's
    monitor: Any  # module: squared_errors, traces
    reference: Any  # module: run
    inverse: Any  # module: currents


# Two threads in numba's `workqueue` layer at once abort the process; this lock makes that impossible.
_one_parallel_kernel = threading.Lock()


def exclusive(kernel: Callable[..., Any], *arguments: Any) -> Any:
    """Calls a parallel kernel, one at a time in the whole process."""
    with _one_parallel_kernel:
        return kernel(*arguments)


def find_stack(circuit: str = "reduced", effects: Iterable[str] = (), controller: str = "cascade") -> Stack:
    """The stack of a drive, a controller, and effects by name (whose order and repetition do not matter)."""
    if circuit not in DRIVES:
        raise InputError(f"no circuit {circuit!r}; circuits are {', '.join(DRIVES)}")
    if controller not in CONTROLLERS:
        raise InputError(f"no controller {controller!r}; controllers are {', '.join(CONTROLLERS)}")
    return _stack(circuit, controller, tuple(sorted(set(effects))))


@cache
def _stack(circuit: str, controller: str, names: tuple[str, ...]) -> Stack:
    from ema_model.effects import find  # effects import physics, which must stand without stacks

    effects = [find(name) for name in names]
    rows = PARAMETER_ROWS + tuple(f"{effect.name}.{p.name}" for effect in effects for p in effect.parameters)
    states = tuple(f"{effect.name}.{state}" for effect in effects for state in effect.states)
    folder = _write((circuit, controller, *names), _composition(circuit, controller, effects))
    package = _import(folder)
    return Stack(
        circuit,
        controller,
        names,
        rows,
        states,
        *(importlib.import_module(f"{package.__name__}.{module}") for module in ("monitor", "reference", "inverse")),
    )


def _composition(circuit: str, controller: str, effects: Sequence[Any]) -> str:
    """Source of the stack's composition.py."""
    imports = [
        '"""Generated: the places where this stack\'s effects act."""',
        "from ema_model.physics.jit import scalar",
        f"from ema_model.physics.controller import {controller}_controller as control",
        f"from ema_model.physics.drive import {circuit}_drive as advance_current",
    ]
    bodies: dict[str, list[str]] = {place: [] for place in PLACES}
    advances: list[str] = []
    row, state = len(PARAMETER_ROWS), 0
    for effect in effects:
        own = [f"p[{(row + j) * LANES} + i]" for j in range(len(effect.parameters))]
        states = [f"s[(first + {state + j}) * {LANES} + i]" for j in range(len(effect.states))]
        row += len(effect.parameters)
        state += len(effect.states)
        for function in effect.places:
            place = function.__name__
            value, *rest = PLACES[place]
            alias = f"{effect.name}_{place}"
            imports.append(f"from {function.__module__} import {place} as {alias}")
            bodies[place].append(f"    {value} = {alias}({', '.join([value, *rest, *own, *states])})")
        if effect.states:
            alias = f"{effect.name}_advance"
            imports.append(f"from {effect.advance_states.__module__} import advance_states as {alias}")
            new = [f"new_{state_name}" for state_name in effect.states]
            advances.append(f"    ({', '.join(new)},) = {alias}({', '.join([*ADVANCE, *own, *states])})")
            advances += [f"    {place} = {value}" for place, value in zip(states, new)]
    functions = []
    for place, arguments in PLACES.items():
        head = f"def {place}({', '.join(arguments)}, s, first, p, i):"
        functions += ["", "", "@scalar", head, *bodies[place], f"    return {arguments[0]}"]
    head = f"def advance_states({', '.join(ADVANCE)}, s, first, p, i):"
    functions += ["", "", "@scalar", head, *(advances or ["    pass"])]
    return "\n".join([*imports, *functions, ""])


def _write(parts: tuple[str, ...], composition: str) -> Path:
    """The stack's folder, written whole or not at all, as several processes may want it at once."""
    key = hashlib.sha256("+".join(parts).encode()).hexdigest()[:16]
    folder = cache_folder() / f"stack_{key}"
    if not (folder / "composition.py").is_file():
        draft = Path(tempfile.mkdtemp(prefix=".draft", dir=cache_folder()))
        for source in (_PACKAGE / "kernels").glob("*.py"):
            shutil.copyfile(source, draft / source.name)
        (draft / "composition.py").write_text(composition, encoding="utf-8")
        draft.chmod(0o700)
        with contextlib.suppress(OSError):  # another process was first
            draft.rename(folder)
        shutil.rmtree(draft, ignore_errors=True)
    return folder


def _import(folder: Path) -> ModuleType:
    name = f"ema_model_{folder.name}"
    spec = importlib.util.spec_from_file_location(
        name, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    assert spec is not None and spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    sys.modules[name] = package
    spec.loader.exec_module(package)
    return package


def _hash_of_sources() -> str:
    digest = hashlib.sha256()
    for path in sorted(path for part in _COMPILED for path in _PACKAGE.glob(part)):
        digest.update(str(path.relative_to(_PACKAGE)).encode() + b"\0" + path.read_bytes() + b"\0")
    for distribution in ("numba", "llvmlite", "numpy"):
        digest.update(importlib.metadata.version(distribution).encode())
    digest.update(f"{sys.version}{platform.machine()}".encode())
    return digest.hexdigest()[:20]


# Taken while the package is imported: what the kernels inline is what the files held at that time.
_SOURCES = _hash_of_sources()


@lru_cache(maxsize=1)
def cache_folder() -> Path:
    """Where this version's stacks lie: under $EMAVIZ_CACHE_DIR or the user's cache, else a temporary folder."""
    for root in _cache_roots():
        folder = root / "kernels" / _SOURCES
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError:
            continue
        os.utime(folder)
        _prune(folder.parent)
        return folder
    return Path(tempfile.mkdtemp(prefix="emaviz-kernels-"))


def _cache_roots() -> list[Path]:
    if given := os.environ.get("EMAVIZ_CACHE_DIR"):
        return [Path(given)]
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return [base / "emaviz"]


def _prune(versions: Path) -> None:
    """Drops the folders of old sources, but none that was used in the last day."""
    others = sorted((p for p in versions.iterdir() if p.name != _SOURCES), key=lambda p: p.stat().st_mtime)
    for old in others[: max(0, len(others) - _KEPT_VERSIONS)]:
        if time.time() - old.stat().st_mtime > 86_400.0:
            shutil.rmtree(old, ignore_errors=True)
