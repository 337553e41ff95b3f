"""The library in one stack: all of its effects compiled together, of which those that are not asked for do nothing.

Each effect's file says the value with which its kernels go on as without it (`Effect.nothing`), so that one stack
serves every model of the library's effects, in place of a stack a model.  It takes about as long to compile as two
small ones, and a simulation takes about three times as long as the bare model's.  So runs with effects go in it, and
so does all that a discovery tries.  A stack of its own pays for a model that is fitted again and again: it is
compiled behind, in another process (`precompile`), and taken by the next fit once it is there.  The signals of both
are the same to rounding (1e-12).
"""

from __future__ import annotations

from collections.abc import Iterable

from ema_model.actuator import Actuator
from ema_model.effects import CATALOGUE
from ema_model.simulation.precompile import compile_ahead, is_compiled
from ema_model.stacks import Stack, find_stack, is_known

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
    twin = [(library, "run")] if actuator.has_reference_model else []
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
