"""An export beside the monitor model and beside recordings: the same steps, inputs and start; and what an export is."""

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
from ema_model.quantities import Axes, all_of, of_signal
from ema_model.recordings import Measurement
from ema_model.result import FLAT, NAME, NULL, Result, as_named
from ema_model.simulation.run import Run, simulate_monitor
from ema_model.text import Document, Lines, Note, Table

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


# --- what an export is: its files, and how far each target is from the monitor model and from the recordings ----------


@dataclass(frozen=True)
class CannotHold:
    """A part of the model that a target has no form for."""

    what: Annotated[str, Meta(description="in words")]  # "load-dependent friction"
    share: Annotated[float, Meta(description="of our error, that the target's is greater by for it", extra=NULL)]


@dataclass(frozen=True)
class TargetProof:
    """One target: its files, and its replay."""

    target: str  # of `TARGETS`
    title: str  # "C"
    files: Annotated[tuple[str, ...], Meta(description="in the folder")]
    checked_with: Annotated[str, Meta(description="what ran it")]  # "compiled by gcc"
    recordings: tuple[RecordingLoss, ...]
    cannot_hold: Annotated[tuple[CannotHold, ...], Meta(description="the loss budget, the greatest share first")] = ()
    notes: tuple[str, ...] = ()

    @property
    def difference(
        self,
    ) -> Annotated[float, Meta(description="the most that it differs by, of a signal's greatest value")]:
        """The most that it differs from the monitor model by, of a signal's greatest size."""
        return max(one.difference for loss in self.recordings for one in loss.signals.values())

    @property
    def real_time(
        self,
    ) -> Annotated[float, Meta(description="seconds of motion in a second of computing", extra=NULL)]:
        """Seconds of motion that it takes a second for."""
        elapsed = sum(loss.elapsed_s for loss in self.recordings)
        return sum(loss.duration_s for loss in self.recordings) / elapsed if elapsed > 0.0 else math.inf

    @property
    def signals(self) -> dict[str, SignalLoss]:
        """Over all recordings together; of those that were measured."""
        found = {}
        for name in dict.fromkeys(name for loss in self.recordings for name in loss.signals):
            several = [(loss.signals[name], loss.duration_s) for loss in self.recordings]
            measured = [(one, weight) for one, weight in several if math.isfinite(one.rmse_ours)]
            if measured:
                weights = [weight for _, weight in measured]
                squares = [(one.rmse**2, one.rmse_ours**2) for one, _ in measured]
                theirs, ours = np.sqrt(np.average(squares, axis=0, weights=weights)).tolist()
                found[name] = SignalLoss(theirs, ours, max(one.difference for one, _ in several))
        return found


@dataclass(frozen=True)
class TargetInFile:
    """One target of an export."""

    proof: Annotated[TargetProof, Meta(extra=FLAT)]
    rmse: Annotated[dict[str, float], Meta(description="over all recordings, by signal", extra=NAME)]
    rmse_ours: Annotated[dict[str, float], Meta(description="the same of the monitor model", extra=NAME)]
    ratio: Annotated[float | None, Meta(description="the greatest quotient of the two; null without recordings")]
    notes: Annotated[list[str], Meta(description="in sentences")]
    recordings: Annotated[list[RecordingLoss], Meta(description="one by one")]


@dataclass(frozen=True, eq=False, repr=False)
class Export(Result):
    """What was exported of an actuator, with its loss."""

    one: Exported
    folder: Annotated[str, Meta(description="as given")]
    targets: tuple[TargetProof, ...]
    simulated: Annotated[bool, Meta(description="true where no recording was given: proved on a run made for it")]
    names: tuple[str, ...] = field(default=())  # of the recordings

    def name_in_files(self, name: str) -> str:
        """A signal's name."""
        return self.axes.signal(name)

    @property
    def name(self) -> Annotated[str, Meta(description="of the actuator")]:
        """As its file says."""
        return self.one.given.name

    @property
    def input(self) -> Annotated[str, Meta(description="what is put in: command_rad, motor_torque_Nm, duty")]:
        """By its name in files."""
        return self.one.command.name

    @property
    def step_s(self) -> Annotated[float, Meta(description="s, the model's step")]:
        """Of time."""
        return self.one.step_s

    @property
    def notes(
        self,
    ) -> Annotated[list[str], Meta(description="what whoever takes it must know, in sentences")]:
        """Of the model that was written."""
        return list(self.one.notes)

    @property
    def by_target(
        self,
    ) -> Annotated[dict[str, TargetInFile], as_named("export", "by target: c, fmu, mjcf, python")]:
        """The targets; of a run that was made for it, without errors beside a recording."""
        return {proof.target: self._in_file(proof) for proof in self.targets}

    def _in_file(self, proof: TargetProof) -> TargetInFile:
        signals = {} if self.simulated else proof.signals
        ratios = [one.rmse / one.rmse_ours for one in signals.values() if one.rmse_ours > 0.0]
        return TargetInFile(
            proof,
            rmse={name: one.rmse for name, one in signals.items()},
            rmse_ours={name: one.rmse_ours for name, one in signals.items()},
            ratio=max(ratios, default=None),
            notes=[*switches(proof), *proof.notes],
            recordings=[one.without_errors if self.simulated else one for one in proof.recordings],
        )

    @property
    def axes(self) -> Axes:
        """Of its signals."""
        return self.one.actuator.axes


# --- in words ---------------------------------------------------------------------------------------------------------


def document_of(result: Export) -> Document:
    """All that is shown of it in words."""
    blocks = [Lines([first_line(result), *result.one.notes])]
    for proof in result.targets:
        blocks += [Lines([in_one_line(proof)]), *([] if result.simulated else [errors(result, proof)])]
        blocks += [Lines([line]) for line in proof.notes]
        blocks += [Note(line) for line in switches(proof)]
        if proof.cannot_hold:
            blocks.append(Note(budget(proof)))
    return Document(blocks)


def first_line(result: Export) -> str:
    """'Thesis EMA is exported to out: C, Python.'."""
    titles = all_of([proof.title for proof in result.targets])
    if result.simulated:
        on = "a run made for it"
    else:
        on = all_of(result.names) if len(result.names) < 4 else f"{len(result.names)} recordings"
    return f"{result.one.given.name} is exported to {result.folder} as {titles}, replayed on {on}."


def in_one_line(proof: TargetProof) -> str:
    """'C (thesis.h, thesis.c), compiled by gcc: within 1.4e-14 of the monitor model; 1 s of motion in 8 ms.'."""
    files = ", ".join(proof.files)
    took = 1e3 / proof.real_time
    spent = f"{took:.3g} ms" if took < 1e3 else f"{1e-3 * took:.3g} s"
    replayed = sum(loss.duration_s for loss in proof.recordings)
    return (
        f"{proof.title} ({files}), {proof.checked_with}: over {replayed:.3g} s it differs from the monitor model by "
        f"{proof.difference:.2g} of a signal's greatest value at most; 1 s of motion takes {spent}."
    )


def errors(result: Export, proof: TargetProof) -> Table:
    """Of each measured signal, the export's error beside ours, over all recordings."""
    rows = []
    for name, one in proof.signals.items():
        shown = of_signal(name, result.axes).scaled([one.rmse_ours])
        rows.append([shown.title, shown.text(one.rmse), shown.text(one.rmse_ours), _ratio(one)])
    return Table((proof.title, "monitor model", "ratio"), rows, "error, rms")


def switches(proof: TargetProof) -> list[str]:
    """'chirp: rounding grows beyond 1e-09 from 0.2310 s on, where the motor comes to rest'; of each that does."""
    if proof.target not in ("c", "fmu", "python"):
        return []  # which are other models, and differ from the start
    found = []
    for loss in proof.recordings:
        begins = [one.begins_s for one in loss.signals.values() if math.isfinite(one.begins_s)]
        if begins:
            at = f", where {loss.switch}" if loss.switch else ""
            found.append(f"{loss.name}: rounding grows beyond {EXACT:g} from {min(begins):.4f} s on{at}.")
    return found


def budget(proof: TargetProof) -> str:
    """'MuJoCo cannot hold load-dependent friction (12 %), sampled control (3.1 %): …'."""
    parts = [
        f"{one.what} ({_percent(one.share)})" if math.isfinite(one.share) else one.what for one in proof.cannot_hold
    ]
    return f"MuJoCo cannot hold {', '.join(parts)}: by so much our own error grows when it is left out."


def _percent(share: float) -> str:
    percent = 100.0 * share
    return f"{percent:.0f} %" if percent >= 9.95 else f"{percent:.2g} %"


def _ratio(one: SignalLoss) -> str:
    return f"{one.rmse / one.rmse_ours:.3f}" if one.rmse_ours > 0.0 else "1" if one.rmse == 0.0 else "∞"
