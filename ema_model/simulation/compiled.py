"""Which compiled kernels a run takes, and those that another process compiles ahead."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ema_model.actuator import Actuator, load_actuator
from ema_model.child_processes import end_with_parent, start_python
from ema_model.effects import CATALOGUE
from ema_model.faults import HEALTHY
from ema_model.kernel_cache import cache_folder
from ema_model.physics.rows import LANES
from ema_model.simulation.pack import initial_reference_state, initial_state, monitor_rows, reference_rows
from ema_model.stacks import Stack, find_stack, is_known

# --- the library in one stack -----------------------------------------------------------------------------------------
# All of its effects are compiled together, of which those that are not asked for do nothing.
# Each effect's file says the value with which its kernels go on as without it (`Effect.nothing`), so that one stack
# serves every model of the library's effects, in place of a stack a model.  It takes about as long to compile as two
# small ones, and a simulation takes about three times as long as the bare model's.  So runs with effects go in it, and
# so does all that a discovery tries.  A stack of its own pays for a model that is fitted again and again: it is
# compiled behind (`compile_behind`), and taken by the next fit once it is there.  The signals of both
# are the same to rounding (1e-12).

# The periodic effects twice: while a model holds one, further orders of it are looked for.
LIBRARY = (*CATALOGUE, *(f"{effect.name}_2" for effect in CATALOGUE.values() if effect.is_periodic))


_only_library = False  # whether `stack_at_hand` does without looking at what is compiled


def always_library() -> None:
    """Lets this process take the library's kernels for its effects wherever they serve, whatever is compiled.

    A model's own give the same but for rounding; so the last digits of what comes out would depend on the cache.
    """
    global _only_library
    _only_library = True


def own_stack(actuator: Actuator, effects: Iterable[str] = (), circuit: str = "reduced") -> Stack:
    """The kernels of an actuator with effects besides its own, and nothing else; circuit: for the hysteresis loop."""
    return find_stack(*_parts(actuator, {*actuator.effects, *effects}, circuit))


def library_stack(actuator: Actuator, circuit: str = "reduced") -> Stack:
    """The kernels of an actuator with the whole library."""
    return find_stack(*_parts(actuator, LIBRARY, circuit))


def stack_at_hand(actuator: Actuator, effects: Iterable[str], circuit: str, kernel: str) -> Stack:
    """The model's own kernels where they are compiled, or have to be; else the library's.

    They have to be without effects, and with those that the library does not have.
    """
    names = {*actuator.effects, *effects}
    if not names or not names <= {*LIBRARY}:
        return own_stack(actuator, names, circuit)
    # What is not known would be written only to look into it.
    if not _only_library and is_known(*_parts(actuator, names, circuit)):
        own = own_stack(actuator, names, circuit)
        if is_compiled(own, kernel):
            return own
    return library_stack(actuator, circuit)


def compile_library(actuator: Actuator) -> None:
    """Begins to compile the library's kernels for fits of an actuator and then for their twin, in another process."""
    library = library_stack(actuator)
    twin = [(library, "runs")] if actuator.has_reference_model else []
    compile_ahead([(library, _fitted_kernel(actuator)), *twin])


def compile_behind(actuator: Actuator) -> None:
    """Begins to compile an actuator's own kernels for the fits to come, where the library's serve until then."""
    if actuator.effects and {*actuator.effects} <= {*LIBRARY}:
        compile_ahead([(own_stack(actuator), _fitted_kernel(actuator))], urgent=False)


def _fitted_kernel(actuator: Actuator) -> str:
    return "currents" if actuator.controller.kind == "unknown" else "traces"


def _parts(actuator: Actuator, effects: Iterable[str], circuit: str) -> tuple[str, Iterable[str], str]:
    """As `find_stack` takes them."""
    kind = actuator.controller.kind
    return actuator.circuit(circuit), effects, "cascade" if kind == "unknown" else kind


# --- kernels that will be needed soon, compiled by another process: numba compiles on one core only -------------------
#     python -m ema_model.simulation.compiled urgent traces+reduced+cascade+torsional_compliance …
#
# compiles kernels of stacks into the cache, where `find_stack`'s kernels are found on their first call.  It ends when
# its input closes, as that of `compile_ahead`'s does with the process that asked.

MODULES = {"traces": "monitor", "currents": "inverse", "run": "reference", "runs": "reference"}  # of the kernels
_POLL_S = 0.02


@dataclass(frozen=True)
class _Job:
    process: subprocess.Popen[bytes]
    kernels: list[tuple[Stack, str]]
    urgent: bool


_running: list[_Job] = []


def compile_ahead(kernels: Iterable[tuple[Stack, str]], *, urgent: bool = True) -> None:
    """Begins to compile kernels of stacks where the cache lacks them; returns at once.  Effects are the catalogue's.

    What is not urgent takes only the time that nobody else wants, and waits for no other (it is asked for again).
    What is not done when this process ends is given up.  EMAVIZ_COMPILE_AHEAD=0 leaves all to this process.
    """
    missing = [one for one in kernels if not is_compiled(*one) and not _is_coming(*one)]
    if not missing or (_running and not urgent):
        return
    if (os.cpu_count() or 1) < 2 or os.environ.get("EMAVIZ_COMPILE_AHEAD") == "0":
        return
    package = str(Path(__file__).parents[2])
    paths = os.pathsep.join(filter(None, [package, os.environ.get("PYTHONPATH")]))
    names = ["+".join((kernel, one.circuit, one.controller, *one.effects)) for one, kernel in missing]
    process = start_python(
        ["-m", __name__, "urgent" if urgent else "behind", *names],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": paths, "EMAVIZ_CACHE_DIR": str(cache_folder().parents[1])},
    )
    _running.append(_Job(process, missing, urgent))


def is_compiled(stack: Stack, kernel: str) -> bool:
    """Whether a kernel of a stack needs no compiler: this process has it, or the cache does."""
    module = getattr(stack, MODULES[kernel])
    if getattr(module, kernel).signatures:
        return True
    return any(cache_folder().glob(f"{module.__name__}.{kernel}-*.nbc"))


def wait_for(stack: Stack, kernel: str) -> None:
    """Returns once a kernel is there that another process compiles urgently, so that it is not compiled here too."""
    while _running and _is_coming(stack, kernel) and not is_compiled(stack, kernel):
        time.sleep(_POLL_S)


def _is_coming(stack: Stack, kernel: str) -> bool:
    _running[:] = [job for job in _running if job.process.poll() is None]
    return any(job.urgent and (stack, kernel) in job.kernels for job in _running)


def compile_here(stack: Stack, kernel: str) -> None:
    """Compiles a kernel of a stack in this process, or finds it in the cache."""
    actuator, samples = load_actuator(), np.zeros(1)
    rows = monitor_rows(actuator, HEALTHY, stack, {})
    if kernel == "traces":
        state = initial_state(actuator, len(rows), stack=stack)
        result = np.empty((len(rows), 1, 4, LANES))
        stack.monitor.traces(state, rows, samples, samples, samples, samples, 1, 1, actuator.step_s, result)
    elif kernel == "currents":
        result = np.empty((len(rows), 1, LANES))
        stack.inverse.currents(rows, samples, samples, samples, samples, samples, 1.0, result)
    else:
        rows = reference_rows(actuator, HEALTHY, stack, {})
        state, pair = initial_reference_state(actuator, stack=stack), np.zeros(2)
        if kernel == "run":
            stack.reference.run(state, rows, pair, pair, pair, 1, 1, 1e-6, np.empty((1, 11)))
        else:
            lanes = stack.reference.RUNS
            stack.reference.runs(state, rows, pair, pair, np.zeros(lanes), 1, 1, 1e-6, np.empty((1, 4, lanes)))


if __name__ == "__main__":
    end_with_parent()
    if sys.argv[1] == "behind" and hasattr(os, "nice"):
        os.nice(15)
    for text in sys.argv[2:]:
        kernel, circuit, controller, *names = text.split("+")
        compile_here(find_stack(circuit, names, controller), kernel)
