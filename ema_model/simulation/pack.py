"""What a run gives its kernels: rows of physical parameters, faults and effects; and which compiled ones it takes."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model import faults
from ema_model.actuator import Actuator, load_actuator
from ema_model.child_processes import end_with_parent, start_python
from ema_model.effects import CATALOGUE, catalogue_name
from ema_model.faults import HEALTHY
from ema_model.kernel_cache import cache_folder
from ema_model.physics.equations import flux_harmonics
from ema_model.physics.rows import LANES, REFERENCE_STATE_ROWS, STATE_ROWS
from ema_model.stacks import Stack, find_stack, is_known

Array = NDArray[np.float64]
EffectSettings = Mapping[str, Mapping[str, ArrayLike]]


@dataclass(frozen=True)
class Circuit:
    """One equivalent winding and the most voltage on it."""

    resistance_Ohm: float
    inductance_H: float
    voltage_V: float


def reduced_circuit(actuator: Actuator) -> Circuit:
    """The exact equivalent of the RM's phases: R, L × 4/(3 s), V = (2/s)(4/π)(bus/2), s the EMF's scale."""
    motor = actuator.motor
    scale = 2.0 / (3.0 * motor.emf_scale)  # of the phase-to-phase values, twice those of a phase
    voltage = 4.0 / np.pi * actuator.inverter.bus_voltage_V / motor.emf_scale
    return Circuit(scale * motor.resistance_Ohm, scale * motor.inductance_H, voltage)


def monitor_rows(actuator: Actuator, k: ArrayLike, stack: Stack, effects: EffectSettings) -> Array:
    """Parameters of the Monitor Model for a population: k (n, 8) → (blocks, rows·LANES).

    effects: besides those that belong to the actuator; the stack's others do nothing.  Parameters are numbers or
    (n,) each.  Lanes beyond n repeat the last individual.
    """
    k = np.atleast_2d(np.asarray(k, dtype=float))
    fault = faults.physical(k)
    motor, inverter = actuator.motor, actuator.inverter
    if stack.circuit == "reduced":
        circuit = reduced_circuit(actuator)
        resistance, inductance = circuit.resistance_Ohm, circuit.inductance_H
        ratio = circuit.voltage_V / inverter.bus_voltage_V
    else:  # without a voltage limit, or with the bus as it is
        resistance, inductance, ratio = motor.resistance_Ohm, motor.inductance_H, 1.0
    # The thesis's Monitor Model leaves it out (T 3.3).
    drag_of_user = 0.0 if inverter.kind == "hysteresis" else actuator.transmission.viscous_friction_Nms_rad
    values = _shared_rows(actuator, fault) | {
        "voltage_ratio": ratio,
        "resistance": resistance,
        "inverse_inductance": 1.0 / inductance,
        "emf_constant": motor.torque_constant_Nm_A,
        "viscous": motor.viscous_friction_Nms_rad + drag_of_user,
    }
    harmonics = flux_harmonics(fault.turns, fault.eccentricity, fault.phase_rad)
    values |= {f"flux_{i}": harmonics[i] for i in range(9)}
    return _blocks(values, stack, {**actuator.effects, **effects}, len(k))


def reference_rows(actuator: Actuator, k: ArrayLike, stack: Stack, effects: EffectSettings) -> Array:
    """Parameters of the Reference Model: k (8,) or (n, 8), n up to LANES → (rows·LANES,); otherwise as the other's."""
    fault = faults.physical(np.asarray(k, dtype=float))
    motor, inverter = actuator.motor, actuator.inverter
    values = _shared_rows(actuator, fault) | {
        "voltage_ratio": 0.5,
        "hysteresis": 0.5 * inverter.hysteresis_band_A,
        "resistance": 0.5 * motor.resistance_Ohm,
        "inverse_inductance": 2.0 / motor.inductance_H,
        "emf_constant": motor.emf_scale * 0.5 * motor.torque_constant_Nm_A,
        "viscous": motor.viscous_friction_Nms_rad + actuator.transmission.viscous_friction_Nms_rad,
        "turns_a": fault.turns[0],
        "turns_b": fault.turns[1],
        "turns_c": fault.turns[2],
        "eccentricity": fault.eccentricity,
        "eccentricity_cos": np.cos(fault.phase_rad),
        "eccentricity_sin": np.sin(fault.phase_rad),
    }
    return _blocks(values, stack, {**actuator.effects, **effects}, 1)[0]


def initial_state(
    actuator: Actuator,
    blocks: int,
    user_rad: ArrayLike = 0.0,
    speed_rad_s: ArrayLike = 0.0,
    play: ArrayLike = 0.0,
    stack: Stack | None = None,
    integral_Nm: ArrayLike = 0.0,
    time_s: float = 0.0,
) -> Array:
    """State of the Monitor Model at the start, (blocks, rows·LANES); the states of the stack's effects are 0.

    user_rad: where the motor stands, as a user's angle; speed_rad_s: the motor's; play: where the user
    stands within the backlash, rad at the motor, 0 in the middle; integral_Nm: what the speed loop's integral action
    has come to (see `integral_at_start`); time_s: since the recording's start.
    """
    rows = STATE_ROWS + (stack.states if stack else ())
    start = user_rad, speed_rad_s, play, integral_Nm, time_s
    return _state(actuator, blocks, rows, 2.0 * actuator.motor.pole_pairs, *start)


def initial_reference_state(
    actuator: Actuator,
    user_rad: ArrayLike = 0.0,
    speed_rad_s: ArrayLike = 0.0,
    play: ArrayLike = 0.0,
    stack: Stack | None = None,
    integral_Nm: ArrayLike = 0.0,
    time_s: float = 0.0,
) -> Array:
    """The same for the Reference Model, (rows·LANES,)."""
    rows = REFERENCE_STATE_ROWS + (stack.states if stack else ())
    start = user_rad, speed_rad_s, play, integral_Nm, time_s
    return _state(actuator, 1, rows, actuator.motor.pole_pairs, *start)[0]


def integral_at_start(
    actuator: Actuator,
    k: ArrayLike,
    command_rad: float,
    user_rad: ArrayLike,
    speed_rad_s: ArrayLike,
    current_A: ArrayLike,
) -> Array:
    """K_I ∫e dt, N·m, of a speed loop that is caught at work: what makes it ask for the current that flows.

    k_t I − K_P (ω_ref − ω), which the drive keeps within the torque of its current's limit, for k (n, 8) or (8,)
    → (n,) or ().  A speed loop without an integral action passes it by: its gain may be an effect's.  It is the
    bumpless start of Åström and Hägglund (Advanced PID Control, ISA 2006), and steady state where the recording begins
    in steady state.  It is of the plain loop; a drive that does more makes its own of it (`advance_drive`).
    """
    controller = actuator.controller
    if controller.kind != "cascade":
        return np.zeros(())
    gain = controller.position_gain_1_s * faults.physical(k).gain_factor
    limit = np.asarray(controller.speed_limit_rad_s, dtype=float)
    with np.errstate(invalid="ignore"):  # a k that is no number is one lane's matter
        error = np.clip(gain * (command_rad - np.asarray(user_rad)), -limit, limit) - np.asarray(speed_rad_s)
        return controller.torque_constant_Nm_A * np.asarray(current_A) - controller.speed_gain_Nms_rad * error


def _state(
    actuator: Actuator,
    blocks: int,
    rows: tuple[str, ...],
    electrical: float,
    user_rad: ArrayLike,
    speed_rad_s: ArrayLike,
    play: ArrayLike,
    integral_Nm: ArrayLike,
    time_s: float,
) -> Array:
    transmission = actuator.transmission
    held = np.clip(np.asarray(user_rad, dtype=float), transmission.stop_low_rad, transmission.stop_high_rad)
    theta = held / transmission.gear_ratio
    rotor = theta + actuator.motor.rotor_offset_rad
    values = {
        "theta": theta,
        "omega": np.asarray(speed_rad_s, dtype=float),
        "play": theta + np.asarray(play, dtype=float),
        "sin_rotor": np.sin(rotor),
        "cos_rotor": np.cos(rotor),
        "sin_electrical": np.sin(electrical * rotor),
        "cos_electrical": np.cos(electrical * rotor),
        "integral": integral_Nm,
        "time": time_s,
    }
    state = np.zeros((blocks, len(rows), LANES))
    for name, value in values.items():
        state[:, rows.index(name), :] = _lanes(value, blocks)
    return state.reshape(blocks, -1)


def _shared_rows(actuator: Actuator, fault: faults.PhysicalFaults) -> dict[str, ArrayLike]:
    controller, motor, transmission = actuator.controller, actuator.motor, actuator.transmission
    tau = transmission.gear_ratio
    if controller.kind == "position":
        full = actuator.current_limit_A if actuator.inverter.kind == "current" else 1.0
        gain, limit = controller.gain_1_rad, controller.output_limit * full
    else:
        gain, limit = controller.position_gain_1_s, actuator.current_limit_A
    return {
        "position_gain": gain * fault.gain_factor,
        "speed_limit": controller.speed_limit_rad_s,
        "speed_gain": controller.speed_gain_Nms_rad,
        "integral_gain": controller.integral_gain_Nm_rad,
        "derivative_gain": controller.derivative_gain_Nms2_rad,
        "integrator_window": controller.integrator_window_rad,
        # The thesis's PID, which the hysteresis drive belongs to, holds its integral at standstill; others do not.
        "integrator_rest": 0.0 if actuator.inverter.kind == "hysteresis" else -1.0,
        "bus_voltage": actuator.inverter.bus_voltage_V,
        "current_per_torque": 1.0 / controller.torque_constant_Nm_A,
        "output_limit": limit,
        "torque_constant": motor.torque_constant_Nm_A,
        "torque_limit": motor.torque_limit_Nm,
        "pole_pairs": motor.pole_pairs,
        "inverse_inertia": 1.0 / motor.inertia_kgm2,
        # No less than in motion: the laws of bristles and of Stribeck fall from it to that level.
        "static_friction": np.maximum(motor.static_friction_Nm, motor.dynamic_friction_Nm) * fault.friction_factor,
        "dynamic_friction": motor.dynamic_friction_Nm * fault.friction_factor,
        "half_play": 0.5 * transmission.backlash_rad * fault.backlash_factor / tau,
        "gear_ratio": tau,
        "stop_low": transmission.stop_low_rad / tau,
        "stop_high": transmission.stop_high_rad / tau,
    }


def _blocks(values: Mapping[str, ArrayLike], stack: Stack, effects: EffectSettings, individuals: int) -> Array:
    blocks = -(-individuals // LANES)
    index, resting = _at_rest(stack.parameter_rows, stack.effects)
    rows = np.empty((blocks, len(resting), LANES))
    rows[:] = resting[:, None]
    of_effects = {f"{effect}.{name}": value for effect, given in effects.items() for name, value in given.items()}
    for name, value in {**values, **of_effects}.items():
        rows[:, index[name], :] = _lanes(value, blocks)
    return rows.reshape(blocks, -1)


@lru_cache(maxsize=64)
def _at_rest(parameter_rows: tuple[str, ...], effects: tuple[str, ...]) -> tuple[dict[str, int], Array]:
    """Of a stack: where each parameter stands, and its rows where no effect of the library does anything, (rows,)."""
    index = {name: row for row, name in enumerate(parameter_rows)}
    resting = np.zeros(len(parameter_rows))
    for effect in effects:
        if catalogue_name(effect) in CATALOGUE:
            for name, value in CATALOGUE[catalogue_name(effect)].neutral.items():
                resting[index[f"{effect}.{name}"]] = value
    return index, resting


def _lanes(value: ArrayLike, blocks: int) -> Array | float:
    """One number, or one for each individual, as what fills (blocks, LANES)."""
    value = np.asarray(value, dtype=float)
    if value.size == 1:
        return value.item()
    return np.concatenate([value, np.full(blocks * LANES - len(value), value[-1])]).reshape(blocks, LANES)


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
#     python -m ema_model.simulation.pack urgent traces+reduced+cascade+torsional_compliance …
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
