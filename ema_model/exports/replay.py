"""An export beside the monitor model and beside recordings: the same steps, the same inputs, the same start."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Annotated, Protocol

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.commands import command
from ema_model.errors import InputError, quoted
from ema_model.exports.exported import Exported
from ema_model.exports.program import field_name
from ema_model.models.closed_loop import ClosedLoop
from ema_model.models.loop_window import COMPARED, LoopWindow
from ema_model.models.open_loop import driven_freely
from ema_model.physics.rows import LANES, STATE_ROWS
from ema_model.recordings import Measurement
from ema_model.result import NAME, NULL
from ema_model.simulation.run import Run, simulate_monitor

Array = NDArray[np.float64]

EXACT = 1e-9  # of a signal's greatest size: up to which two programs of one model may differ by rounding


class Replay(Protocol):
    """An export that runs."""

    def replay(self, state: Array, parameters: Array, run: tuple[Array, ...], period: int, step_s: float) -> Array:
        """The four signals of each sample of `period` steps, (samples, 4).

        state: of `Exported.states`; parameters: of `Exported.parameters`; run: what is put in, load and supply at each
        step.
        """
        ...


@dataclass(frozen=True)
class SignalLoss:
    """One signal of an export over one recording, in the signal's unit; NaN where it was not measured."""

    rmse: Annotated[
        float, Meta(description="of the export beside the recording; null where it was not measured", extra=NULL)
    ]
    rmse_ours: Annotated[float, Meta(description="the same of the monitor model", extra=NULL)]
    difference: Annotated[float, Meta(description="the most that both differ by, of the signal's greatest value")]
    begins_s: Annotated[  # of the recording, where that is more than `EXACT`
        float, Meta(description="s, from where on that is more than 1e-9; null: never", extra=NULL)
    ] = math.nan


@dataclass(frozen=True, eq=False)
class RecordingLoss:
    """An export over one recording; arrays are (samples,)."""

    name: Annotated[str, Meta(description="of the recording")]
    duration_s: Annotated[float, Meta(description="s, that were replayed")]
    elapsed_s: Annotated[float, Meta(description="s, that the export took for it")]
    signals: Annotated[dict[str, SignalLoss], Meta(description="by name", extra=NAME)]
    time_s: Array = field(repr=False)
    measured: dict[str, Array] = field(repr=False)  # where it was
    ours: dict[str, Array] = field(repr=False)
    shown: dict[str, Array] = field(repr=False)  # by the export
    switch: Annotated[str, Meta(description="what switches where a difference begins, in words; empty: nothing")] = ""

    @property
    def without_errors(self) -> RecordingLoss:
        """The same of a run that was made for it, which is no recording to be off from."""
        signals = {name: replace(one, rmse=math.nan, rmse_ours=math.nan) for name, one in self.signals.items()}
        return replace(self, signals=signals)


@dataclass(frozen=True, eq=False)
class Proof:
    """Recordings ready to be replayed: the model with its windows, what it shows, and what was measured."""

    one: Exported
    model: ClosedLoop
    ours: tuple[dict[str, Array], ...] = field(repr=False)  # by window, (samples,)
    simulated: bool = False  # whether nothing was recorded, so that there is no error to tell

    @property
    def windows(self) -> Sequence[LoopWindow]:
        """Runs of the recordings."""
        return self.model.windows


def proof_of(one: Exported, recordings: Sequence[Measurement], progress: Callable[[str], None]) -> Proof:
    """The monitor model over the recordings, of every sample; without any, over a run that is made for it.

    Raises InputError for recordings that cannot be simulated, and where the model diverges.
    """
    maps = [m.name for m in recordings if m.is_map]
    if maps:
        raise InputError(f"{quoted(maps[0])}: a static map has no motion over time to replay; leave it out")
    progress("simulating the monitor model")
    actuator, given = one.actuator, recordings or [_made_up(one)]
    if one.given.controller.kind == "unknown" and recordings:
        model, offsets = driven_freely(given, one.given)
        model.windows = [replace(w, command=w.command + offsets[w.recording]) for w in model.windows]
    else:
        model = ClosedLoop(given, actuator, block_s=0.0)
    ours = []
    for place, window in enumerate(model.windows):
        shown = {name: values[0] for name, values in model.signals(place).items()}
        bad = [name for name, values in shown.items() if not np.all(np.isfinite(values))]
        if bad:
            raise InputError(
                f"{quoted(window.name)}: the model diverges in {bad[0]}; compare it with its recordings first"
            )
        ours.append(shown)
    return Proof(one, model, tuple(ours), not recordings)


def shortened(proof: Proof, most_steps: int) -> Proof:
    """The first part of each window, so that all together take no more than so many steps."""
    steps = sum(len(window.command) for window in proof.windows)
    if steps <= most_steps:
        return proof
    share = most_steps / steps
    windows, ours = [], []
    for window, shown in zip(proof.windows, proof.ours):
        blocks = max(1, int(window.blocks * share))
        at = blocks * window.steps_per_sample
        windows.append(
            replace(
                window,
                time_s=window.time_s[:blocks],
                measured={name: values[:blocks] for name, values in window.measured.items()},
                command=window.command[:at],
                load=window.load[:at],
                supply=window.supply[:at],
            )
        )
        ours.append({name: values[:blocks] for name, values in shown.items()})
    model = copy(proof.model)
    model.windows = windows
    return replace(proof, model=model, ours=tuple(ours))


def replayed(proof: Proof, export: Replay, progress: Callable[[str], None]) -> list[RecordingLoss]:
    """The export over every window."""
    found = []
    for number, (window, ours) in enumerate(zip(proof.windows, proof.ours), 1):
        progress(f"replaying {window.name or 'a run'} ({number} of {len(proof.windows)})")
        began = time.perf_counter()
        shown = _shown(proof, export, window)
        elapsed = time.perf_counter() - began
        found.append(loss_of(proof.one, window, ours, shown, elapsed))
    return found


def kernel_values(proof: Proof, window: LoopWindow) -> tuple[Actuator, dict[str, float], dict[str, float]]:
    """The actuator as it was in a window; its kernels' parameters and its state at the start, by name."""
    actuator, rows, states = proof.model.begun(window)
    stack = proof.model.stack
    parameters = dict(zip(stack.parameter_rows, rows[0].reshape(-1, LANES)[:, 0].tolist()))
    return actuator, parameters, dict(zip((*STATE_ROWS, *stack.states), states[0].reshape(-1, LANES)[:, 0].tolist()))


def _shown(proof: Proof, export: Replay, window: LoopWindow) -> dict[str, Array]:
    """What the export shows of a window, as the sensors show it."""
    one, model = proof.one, proof.model
    actuator, values, at_start = kernel_values(proof, window)
    known = {field_name(name): value for name, value in at_start.items()}
    state = np.array([known[field.name] for field in one.states])
    put_in = window.command
    if one.takes_torque:  # the kernels take the current
        put_in = put_in * actuator.motor.torque_constant_Nm_A
    run = (put_in, window.load, window.supply)
    shown = export.replay(state, one.values(values), run, window.steps_per_sample, window.step_s)
    signals = {name: np.ascontiguousarray(shown[None, :, place]) for place, name in enumerate(COMPARED)}
    return {name: of[0] for name, of in model.sensed(signals, actuator, window.block_s).items()}


def loss_of(
    one: Exported, window: LoopWindow, ours: dict[str, Array], shown: dict[str, Array], elapsed_s: float
) -> RecordingLoss:
    """How far an export that showed this is from the monitor model and from what was measured."""
    signals, first, where = {}, math.inf, ""
    for name in COMPARED:
        away = np.abs(shown[name] - ours[name])
        largest = float(np.max(np.abs(ours[name]))) or 1.0
        measured = window.measured.get(name)
        begins = math.nan
        if np.any(~(away <= EXACT * largest)):
            at = int(np.argmax(~(away <= EXACT * largest)))
            begins = float(window.time_s[at])
            if begins < first:
                first, where = begins, _switch(one, ours, at)
        signals[name] = SignalLoss(
            _rms(shown[name], measured), _rms(ours[name], measured), float(np.max(away)) / largest, begins
        )
    arrays = window.time_s, window.measured, ours, shown
    return RecordingLoss(window.name, window.blocks * window.block_s, elapsed_s, signals, *arrays, where)


_MOVES = 0.2  # of a chirp's amplitude, from which on the user follows it
_NEAR = 20  # samples before a difference, in which it may have begun


def _switch(one: Exported, ours: dict[str, Array], at: int) -> str:
    """What switches where a difference begins: 'the motor comes to rest'; empty where nothing does."""
    near = slice(max(0, at - _NEAR), at + 2)
    speed, current = ours["motor_speed_rad_s"][near], ours["current_A"][near]
    rests = speed == 0.0
    if np.any(rests) and not np.all(rests):
        return "the motor comes to rest, or breaks away"
    if np.any(speed[1:] * speed[:-1] < 0.0):
        return "the motor turns round"
    limit = float(np.max(np.abs(one.actuator.current_limit_A)))
    if math.isfinite(limit) and np.any(np.abs(current) >= 0.999 * limit):
        return "the current is at its limit"
    return ""


def _rms(shown: Array, measured: Array | None) -> float:
    return math.nan if measured is None else float(np.sqrt(np.mean((shown - measured) ** 2)))


def _moving_chirp(actuator: Actuator) -> Measurement:
    """A chirp that is wide enough to move the user against play and friction, if any is."""
    for amplitude in (5e-3, 5e-2, 0.5):
        slow = {"end_Hz": 5.0} if amplitude > 5e-3 else {}
        shown = simulate_monitor(Run(command("chirp", {"amplitude_rad": amplitude, **slow})), actuator)
        if np.ptp(shown["user_position_rad"]) > _MOVES * amplitude:
            break
    return shown


def _made_up(one: Exported) -> Measurement:
    """A run to replay where nothing was recorded: a chirp of the command, or a torque that goes to and fro."""
    actuator: Actuator = one.actuator
    if actuator.controller.kind != "open":
        return replace(_moving_chirp(actuator), name="chirp")
    seconds = np.linspace(0.0, 0.5, 5001)
    swing = np.sin(2.0 * np.pi * (2.0 * seconds + 20.0 * seconds**2))
    name, size = "duty", 0.5
    if one.takes_torque:
        friction = max(actuator.motor.static_friction_Nm, actuator.motor.dynamic_friction_Nm)
        name, size = "motor_torque_Nm", 3.0 * friction + 1e-3
    return Measurement({"time_s": seconds, "user_position_rad": 0.0 * seconds, name: size * swing}, name="swing")
