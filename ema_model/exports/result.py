"""What an export is: its files, and how far each target is from the monitor model and from the recordings."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from msgspec import Meta

from ema_model.exports.exported import Exported
from ema_model.exports.replay import EXACT, RecordingLoss, SignalLoss
from ema_model.quantities import Axes, all_of, of_signal
from ema_model.result import FLAT, NAME, NULL, Result, as_named
from ema_model.text import Document, Lines, Note, Table


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
