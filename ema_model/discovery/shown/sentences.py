"""Further sentences of a discovery, as page, reports and recordings show them: its warnings, what had been masked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ema_model.actuator.naming import on_axes
from ema_model.discovery.observed.controller import ControllerSeen
from ema_model.discovery.result import Added
from ema_model.discovery.shown.labels import effect_title
from ema_model.effects import find
from ema_model.faults import BY_NAME
from ema_model.quantities.axes import Axes
from ema_model.quantities.numbers import amount, number, with_uncertainty
from ema_model.quantities.titles import all_of, in_sentence

LOOP_UNTOLD = (
    "In the closed loop no effect explains the whole error, and nothing shows another control law than the file's: how "
    "the drive samples, filters or delays may differ. What the measured motion needs of the motor is reported instead, "
    "without a controller."
)
OPEN_LOOP_LEFT = (
    "In open loop the noise of the recorded current adds up in the motion. What the measured motion needs of the motor "
    "is compared instead."
)
NOT_REPEATABLE = (
    "The closed loop is not repeatable (a change of 0.05 % in the inertia moves its signals by more than the noise): "
    "what the measured motion needs is compared instead."
)


def mismatch(seen: ControllerSeen | None, axes: Axes) -> list[str]:
    """That the controller is not what the file says, and what was seen instead."""
    if seen is None:
        return []
    parts = []
    for gain in seen.gains:
        if seen.holds and gain.differs:
            one = on_axes(gain.path, axes)
            told = with_uncertainty(gain.seen, gain.half, one.unit)
            parts.append(f"a {in_sentence(one.title)} of {told} where the file has {amount(gain.file, one.unit)}")
    if seen.late:
        parts.append(f"an answer that comes {number(1e3 * seen.delay_s, 2)} ms later")
    told = f"On the measured motion the drive's current shows {' and '.join(parts)}. " if parts and seen.holds else ""
    left, best = (f"{100.0 * share:.0f} %" for share in (seen.left_by_file, seen.left))
    form = "" if seen.holds else ", so that it is of another form"
    return [
        f"The controller is not what the file says. {told}Of that current the file's controller leaves {left} "
        f"unexplained, the best one of the same form {best}{form}. What the measured motion needs of the motor is "
        "reported instead, without a controller."
    ]


def masked(added: Sequence[Added], axes: Axes) -> list[str]:
    """One line for each effect that parameters of the model had been standing in for, and where they are now."""
    moved: dict[str, dict[str, tuple[float, float]]] = {}  # by effect: at several orders it is one
    for one in added:
        parts = moved.setdefault(one.name, {})
        for part in one.stood_in:
            if part.path != one.stands_for:
                parts[part.path] = parts.get(part.path, (part.before, part.after))[0], part.after
    return [f"{find(name).title} had been masked by {_moved(parts, axes)}." for name, parts in moved.items() if parts]


def _moved(parts: Mapping[str, tuple[float, float]], axes: Axes) -> str:
    """'motor torque constant (−2.5 → −0.4 σ), now nearer to its nominal value'."""
    ends = {path: [f"{round(end, 1) + 0.0:+.1f}".replace("-", "−") for end in both] for path, both in parts.items()}
    told = [f"{in_sentence(on_axes(path, axes).title)} ({a} → {b} σ)" for path, (a, b) in ends.items()]
    return f"{all_of(told)}, now nearer to {'its nominal value' if len(told) == 1 else 'their nominal values'}"


def as_well(ties: Mapping[str, str], added: Sequence[Added], faults: Sequence[str]) -> list[str]:
    """One line for each fault and effect of which one was taken, and the other would explain as much.

    ties: effects by fault; or other faults.
    """
    names, lines = {*faults, *(one.name for one in added)}, []
    for fault, effect in ties.items():
        label, title = f"the fault {BY_NAME[fault].label}", effect_title(effect)
        if effect in names and fault not in faults:
            lines.append(f"T{label[1:]} would explain as much as {in_sentence(title)}.")
        elif fault in faults and effect not in names:
            lines.append(f"{title} would explain as much as {label}.")
    return lines


def held_back(paths: Sequence[str], axes: Axes) -> list[str]:
    """One line on parameters that stay as the file says, since what is missing would drive them to their bounds."""
    if not paths:
        return []
    names = ", ".join(in_sentence(on_axes(path, axes).title) for path in paths)
    return [
        f"Kept as the file says, since what is missing would drive {'it' if len(paths) == 1 else 'them'}"
        f" to the edge of tolerance: {names}."
    ]


def untold(first: str, second: str) -> str:
    """That no test is known which would tell two effects apart."""
    one, other = (in_sentence(effect_title(name)) for name in (first, second))
    return f"No command within the range of these recordings tells {one} from {other}."
