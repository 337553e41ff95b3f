"""What an export is: its files, and how far each target is from the monitor model and from the recordings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, TypedDict

import numpy as np
from msgspec import Meta

from ema_model.exports.exported import Exported
from ema_model.exports.replay import EXACT, RecordingLoss, SignalLoss
from ema_model.quantities.axes import Axes, of_signal
from ema_model.quantities.numbers import plain
from ema_model.quantities.titles import all_of
from ema_model.text import Document, InWords, Lines, Note, Table


@dataclass(frozen=True)
class CannotHold:
    """A part of the model that a target has no form for."""

    what: str  # "load-dependent friction"
    share: float  # of our own error, that the target's is greater by for it; NaN where that is not known


@dataclass(frozen=True)
class TargetProof:
    """One target: its files, and its replay."""

    target: str  # of `TARGETS`
    title: str  # "C"
    files: tuple[str, ...]
    checked_with: str  # "compiled by gcc"
    recordings: tuple[RecordingLoss, ...]
    cannot_hold: tuple[CannotHold, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def difference(self) -> float:
        """The most that it differs from the monitor model by, of a signal's greatest size."""
        return max(one.difference for loss in self.recordings for one in loss.signals.values())

    @property
    def real_time(self) -> float:
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


@dataclass(frozen=True, eq=False, repr=False)
class Export(InWords):
    """What was exported of an actuator."""

    one: Exported
    folder: str
    targets: tuple[TargetProof, ...]
    simulated: bool  # whether no recording was given, so that the proof is against the monitor model alone
    names: tuple[str, ...] = field(default=())  # of the recordings

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


# --- as JSON ----------------------------------------------------------------------------------------------------------


class SignalLossJson(TypedDict):
    """One signal of an export over one recording."""

    rmse: Annotated[
        float | None, Meta(description="of the export beside the recording; null where it was not measured")
    ]
    rmse_ours: Annotated[float | None, Meta(description="the same of the monitor model")]
    difference: Annotated[float, Meta(description="the most that both differ by, of the signal's greatest value")]
    begins_s: Annotated[float | None, Meta(description="s, from where on that is more than 1e-9; null: never")]


class RecordingLossJson(TypedDict):
    """An export over one recording."""

    name: Annotated[str, Meta(description="of the recording")]
    duration_s: Annotated[float, Meta(description="s, that were replayed")]
    elapsed_s: Annotated[float, Meta(description="s, that the export took for it")]
    switch: Annotated[str, Meta(description="what switches where a difference begins, in words; empty: nothing")]
    signals: Annotated[dict[str, SignalLossJson], Meta(description="by name")]


class CannotHoldJson(TypedDict):
    """A part of the model that a target has no form for."""

    what: Annotated[str, Meta(description="in words")]
    share: Annotated[float | None, Meta(description="of our error, that the target's is greater by for it")]


class TargetJson(TypedDict):
    """One target of an export."""

    files: Annotated[list[str], Meta(description="in the folder")]
    checked_with: Annotated[str, Meta(description="what ran it")]
    rmse: Annotated[dict[str, float], Meta(description="over all recordings, by signal")]
    rmse_ours: Annotated[dict[str, float], Meta(description="the same of the monitor model")]
    ratio: Annotated[float | None, Meta(description="the greatest quotient of the two; null without recordings")]
    difference: Annotated[float, Meta(description="the most that it differs by, of a signal's greatest value")]
    real_time: Annotated[float, Meta(description="seconds of motion in a second of computing")]
    cannot_hold: Annotated[list[CannotHoldJson], Meta(description="the loss budget, the greatest share first")]
    notes: Annotated[list[str], Meta(description="in sentences")]
    recordings: Annotated[list[RecordingLossJson], Meta(description="one by one")]


class ExportJson(TypedDict):
    """What was exported of an actuator, with its loss."""

    name: Annotated[str, Meta(description="of the actuator")]
    folder: Annotated[str, Meta(description="as given")]
    input: Annotated[str, Meta(description="what is put in: command_rad, motor_torque_Nm, duty")]
    step_s: Annotated[float, Meta(description="s, the model's step")]
    simulated: Annotated[bool, Meta(description="true where no recording was given: proved on a run made for it")]
    notes: Annotated[list[str], Meta(description="what whoever takes it must know, in sentences")]
    export: Annotated[dict[str, TargetJson], Meta(description="by target: c, fmu, mjcf, python")]


def as_dict(result: Export) -> ExportJson:
    """The fields of --json."""
    found: ExportJson = {
        "name": result.one.given.name,
        "folder": result.folder,
        "input": result.one.command.name,
        "step_s": result.one.step_s,
        "simulated": result.simulated,
        "notes": list(result.one.notes),
        "export": {proof.target: _target(proof, result) for proof in result.targets},
    }
    return plain(found)


def _target(proof: TargetProof, result: Export) -> TargetJson:
    signals = {} if result.simulated else proof.signals
    shown = result.axes.signal
    ratios = [one.rmse / one.rmse_ours for one in signals.values() if one.rmse_ours > 0.0]
    return {
        "files": list(proof.files),
        "checked_with": proof.checked_with,
        "rmse": {shown(name): one.rmse for name, one in signals.items()},
        "rmse_ours": {shown(name): one.rmse_ours for name, one in signals.items()},
        "ratio": max(ratios) if ratios else None,
        "difference": proof.difference,
        "real_time": proof.real_time,
        "cannot_hold": [{"what": one.what, "share": one.share} for one in proof.cannot_hold],
        "notes": [*switches(proof), *proof.notes],
        "recordings": [_recording(loss, result) for loss in proof.recordings],
    }


def _recording(loss: RecordingLoss, result: Export) -> RecordingLossJson:
    signals: Mapping[str, SignalLoss] = loss.signals
    return {
        "name": loss.name,
        "duration_s": loss.duration_s,
        "elapsed_s": loss.elapsed_s,
        "switch": loss.switch,
        "signals": {
            result.axes.signal(name): {
                "rmse": None if result.simulated else one.rmse,
                "rmse_ours": None if result.simulated else one.rmse_ours,
                "difference": one.difference,
                "begins_s": one.begins_s,
            }
            for name, one in signals.items()
        },
    }
