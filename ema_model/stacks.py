"""The models' kernels for a stack of effects: a controller, a drive and some effects, composed and compiled.

numba never notices that a function which a kernel inlined was edited elsewhere, nor that it now stands for another.
So each stack becomes a package of its own: the modules of `ema_model.kernels` beside a generated `composition`
that inlines the stack, under a name that tells what it is made of.  `kernel_cache` keeps what is compiled.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.abc
import importlib.util
import linecache
import os
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

import numba

from ema_model.effects import find
from ema_model.effects.effect import ADVANCE, PLACES, STAGES
from ema_model.errors import InputError
from ema_model.kernel_cache import cache_folder
from ema_model.physics.rows import LANES, PARAMETER_ROWS

CIRCUITS = ("thesis", "reduced")  # the drives that stand for the hysteresis current loop
DRIVES = (*CIRCUITS, "current", "voltage")
CONTROLLERS = ("cascade", "position", "open")


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


class ForkedError(RuntimeError):
    """Kernels are asked for in a process where they would hang or abort it: forked from one that used them."""


# Two threads in numba's `workqueue` layer at once abort the process; this lock makes that impossible.
_one_parallel_kernel = threading.Lock()
_used = False  # whether this process, or one that it was forked from, has begun to use kernels
_forked = False  # whether it had begun before the fork: its threads are gone, and its locks may be held for ever


def _begin_child() -> None:
    global _forked
    _forked = _used


if hasattr(os, "register_at_fork"):  # not on Windows, which cannot fork
    os.register_at_fork(after_in_child=_begin_child)


def refuse_after_fork() -> None:
    """Raises ForkedError in a process where kernels would hang or abort it."""
    if _forked:
        raise ForkedError(
            "kernels cannot run in a process forked from one that has used them; start it by multiprocessing's "
            '"spawn" method: multiprocessing.get_context("spawn")'
        )


def exclusive(kernel: Callable[..., Any], *arguments: Any, jobs: int | None = None) -> Any:
    """Calls a parallel kernel, one at a time in the whole process; ForkedError as `find_stack`.

    jobs: how many threads have something to do, all without it.  The others are left out: numba waits for each of
    them, which beside a busy browser takes as long as several simulations.
    """
    refuse_after_fork()
    with _one_parallel_kernel:
        threads = numba.get_num_threads()
        if jobs is None or jobs >= threads:
            return kernel(*arguments)
        numba.set_num_threads(jobs)  # of this thread
        try:
            return kernel(*arguments)
        finally:
            numba.set_num_threads(threads)


def find_stack(circuit: str = "reduced", effects: Iterable[str] = (), controller: str = "cascade") -> Stack:
    """The stack of a drive, a controller, and effects by name (whose order and repetition do not matter).

    InputError tells an unknown name; ForkedError a process forked from one that has used kernels.
    """
    global _used
    refuse_after_fork()
    _used = True
    if circuit not in DRIVES:
        raise InputError(f"no circuit {circuit!r}; circuits are {', '.join(DRIVES)}")
    if controller not in CONTROLLERS:
        raise InputError(f"no controller {controller!r}; controllers are {', '.join(CONTROLLERS)}")
    return _stack(circuit, controller, tuple(sorted(set(effects))))


def is_known(circuit: str, effects: Iterable[str], controller: str) -> bool:
    """Whether some kernel of this stack is compiled, in this process or in the cache."""
    name = _package_of((circuit, controller, *sorted(set(effects))))
    return name in _compositions or any(cache_folder().glob(f"{name}.*.nbc"))


@cache
def _stack(circuit: str, controller: str, names: tuple[str, ...]) -> Stack:
    effects = [find(name) for name in names]
    rows = PARAMETER_ROWS + tuple(f"{effect.name}.{p.name}" for effect in effects for p in effect.parameters)
    states = tuple(f"{effect.name}.{state}" for effect in effects for state in effect.states)
    package = _import((circuit, controller, *names), _composition(circuit, controller, effects))
    return Stack(
        circuit,
        controller,
        names,
        rows,
        states,
        *(importlib.import_module(f"{package}.{module}") for module in ("monitor", "reference", "inverse")),
    )


def _composition(circuit: str, controller: str, effects: Sequence[Any]) -> str:
    """Source of the stack's composition.py."""
    imports = [
        '"""Generated: the places where this stack\'s effects act."""',
        "from ema_model.physics.jit import passed_on, scalar",
        f"from ema_model.physics.equations import {controller}_controller as control",
        f"from ema_model.physics.equations import {circuit}_drive as advance_current",
    ]
    bodies: dict[str, list[str]] = {place: [] for place in PLACES}
    advances: list[str] = []
    acting: list[str] = []  # whether an effect of the drive does anything
    row, state = len(PARAMETER_ROWS), 0
    for effect in effects:
        own = [f"p[{(row + j) * LANES} + i]" for j in range(len(effect.parameters))]
        states = [f"s[(first + {state + j}) * {LANES} + i]" for j in range(len(effect.states))]
        row += len(effect.parameters)
        state += len(effect.states)
        new = [f"new_{state_name}" for state_name in effect.states]
        if effect.acts_in_drive:
            acting.append(f"({own[0]} != {effect.nothing!r})")
        for function in effect.places:
            place = function.__name__
            if place == "current_reference" and circuit == "voltage":
                continue  # a duty is no current: there is no current loop
            value, *rest = PLACES[place]
            alias = f"{effect.name}_{place}"
            imports.append(f"from {function.__module__} import {place} as {alias}")
            renewed = new if place in STAGES else []
            bodies[place].append(
                f"    {', '.join([value, *renewed])} = {alias}({', '.join([value, *rest, *own, *states])})"
            )
            bodies[place] += [f"    {where} = {fresh}" for where, fresh in zip(states, renewed)]
        if effect.advance_states is not None:
            alias = f"{effect.name}_advance"
            imports.append(f"from {effect.advance_states.__module__} import advance_states as {alias}")
            advances.append(f"    ({', '.join(new)},) = {alias}({', '.join([*ADVANCE, *own, *states])})")
            advances += [f"    {place} = {value}" for place, value in zip(states, new)]
    functions = []
    for place, arguments in PLACES.items():
        head = f"def {place}({', '.join(arguments)}, s, first, p, i):"
        decorator = "@scalar" if bodies[place] else "@passed_on"
        functions += ["", "", decorator, head, *bodies[place], f"    return {arguments[0]}"]
    functions += ["", "", "@scalar", "def drive_acts(p, i):", f"    return {' | '.join(acting) or 'False'}"]
    head = f"def advance_states({', '.join(ADVANCE)}, s, first, p, i):"
    functions += ["", "", "@scalar" if advances else "@passed_on", head, *(advances or ["    pass"])]
    return "\n".join([*imports, *functions, ""])


def _import(parts: tuple[str, ...], composition: str) -> str:
    """Makes the stack's package; its name."""
    name = _package_of(parts)
    _compositions[name] = composition
    importlib.import_module(name)
    return name


def _package_of(parts: tuple[str, ...]) -> str:
    """The name of a stack's package, which tells its parts: compiled kernels are found again under it."""
    return f"ema_model_stack_{hashlib.sha256('+'.join(parts).encode()).hexdigest()[:16]}"


_compositions: dict[str, str] = {}  # sources, by the name of the stack's package


class _Modules(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Makes a stack's modules: those of `ema_model.kernels` executed anew, beside the stack's own `composition`.

    Nothing of a stack but its compiled kernels is read from the cache.
    """

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        package, _, module = fullname.partition(".")
        return ModuleSpec(fullname, self, is_package=not module) if package in _compositions else None

    def exec_module(self, module: ModuleType) -> None:
        package, dot, name = module.__name__.partition(".")
        if name == "composition":
            composed, file = _compositions[package], f"<{module.__name__}>"
            # for whoever reads the functions' sources: tracebacks, and what exports them
            linecache.cache[file] = (len(composed), None, composed.splitlines(keepends=True), file)
            code = compile(composed, file, "exec")
        else:
            source = importlib.util.find_spec(f"ema_model.kernels{dot}{name}")
            if source is None or not isinstance(source.loader, importlib.abc.InspectLoader):
                raise ModuleNotFoundError(f"no module {name!r} of kernels", name=module.__name__)
            code = source.loader.get_code(source.name)
            assert code is not None
        exec(code, vars(module))


sys.meta_path.insert(0, _Modules())
