"""Lines over time of compared recordings and of recorded runs: one beside its model, or many over each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.result import Compared, Comparison
from ema_model.recordings import SIGNALS
from ema_model.recordings.window import event
from emaviz.colours import CASES, DIFFERENCE, MONITOR, REFERENCE
from emaviz.figures import theme
from emaviz.figures.comparison import of_residual, quantity_of_signal
from emaviz.figures.lines import Line, Lines, Window
from emaviz.recording.read import Recording

Array = NDArray[np.float64]

# --- a comparison's recordings ----------------------------------------------------------------------------------------

_POSITIONS = ("user_position_rad", "motor_position_rad")


def models(comparison: Comparison, one: Compared) -> dict[str, dict[str, Array]]:
    """What is drawn beside the measured signals, by its name: the model, and where it was calibrated, before that."""
    if comparison.calibration is None:
        return {"model": one.model}
    return {"calibrated": one.model, "uncalibrated": one.initial}


def compared(comparison: Comparison, signal: str, recording: int) -> list[Lines]:
    """A signal as measured and modelled, and what the model leaves of it; none where it was not recorded."""
    one = comparison.recordings[recording]
    if signal not in one.measured:
        return []
    shown = quantity_of_signal(comparison, signal).scaled(one.measured[signal])
    left = one.measured[signal] - one.model[signal]
    rest = of_residual(comparison, signal).scaled(left)
    looks = (theme.MODEL, "solid"), (theme.INITIAL, "dot")
    beside = [
        Line(name, colour, one.time_s, shown.factor * values[signal], dash)
        for (name, values), (colour, dash) in zip(models(comparison, one).items(), looks)
    ]
    measured = Line("measured", theme.MEASURED, one.time_s, shown.factor * one.measured[signal])
    residual = Line("residual", theme.RESIDUAL, one.time_s, rest.factor * left)
    return [Lines(shown.title, shown.unit, [measured, *beside], (0, 1)), Lines(rest.title, rest.unit, [residual])]


def event_of_recording(one: Compared) -> Window | None:
    """When something happens in a recording: in its positions, where they were recorded."""
    names = [name for name in _POSITIONS if name in one.measured] or list(one.measured)
    return event(one.time_s, *(one.measured[name] for name in names))


def together(comparison: Comparison, signal: str) -> list[Lines]:
    """As `compared`, of all recordings that have it, held-out ones too; each from its event on, where all have one."""
    every = [one for one in (*comparison.recordings, *comparison.holdout) if signal in one.measured]
    if not every:
        return []
    events = [window[0] for one in every if (window := event_of_recording(one)) is not None]
    aligned = len(events) == len(every)
    starts = events if aligned else [float(one.time_s[0]) for one in every]
    time = f"Time, each from its {'event' if aligned else 'start'} on [s]"
    shown = quantity_of_signal(comparison, signal).scaled(np.concatenate([one.measured[signal] for one in every]))
    lefts = [one.measured[signal] - one.model[signal] for one in every]
    rest = of_residual(comparison, signal).scaled(np.concatenate(lefts))
    over: list[Line] = []
    apart: list[Line] = []
    for i, (one, start, left) in enumerate(zip(every, starts, lefts)):
        colour, time_s = CASES[i % len(CASES)], one.time_s - start
        over.append(Line(f"{one.name}, measured", colour, time_s, shown.factor * one.measured[signal]))
        for (name, values), dash in zip(models(comparison, one).items(), ("dash", "dot")):
            over.append(Line(f"{one.name}, {name}", colour, time_s, shown.factor * values[signal], dash))
        apart.append(Line(one.name, colour, time_s, rest.factor * left))
    second = 1 + len(models(comparison, every[0]))
    pair = (second, 0) if len(every) > 1 else (0, 1)
    return [
        Lines(shown.title, shown.unit, over, pair, time),
        Lines(f"{rest.title} (measured − model)", rest.unit, apart, (1, 0) if len(every) > 1 else None, time),
    ]


# --- recorded runs ----------------------------------------------------------------------------------------------------

_RECORDED = ("reference", "dot"), ("measurement", "dot"), ("monitor", "solid")


def recorded(named: Sequence[tuple[str, str, Recording]], signal: str) -> list[Lines]:
    """A signal of recorded runs, and what is left of it; named: what each is called, and its colour, "" for usual ones.

    The second is without lines where no run has a residual.
    """
    over: list[Line] = []
    apart: list[Line] = []
    begins: list[int] = []  # of each run among the lines
    title, unit = SIGNALS[signal].title, SIGNALS[signal].unit or "-"
    for name, colour, one in named:
        begins.append(len(over))
        for group, dash in _RECORDED:
            series = one.signals.get(group, {}).get(signal)
            if series is not None:
                said, usual = ("fitted", MONITOR) if group == "monitor" else ("recorded", REFERENCE)
                over.append(Line(f"{name} {said}".strip(), colour or usual, series.time_s, series.values, dash))
        left = one.signals.get("residual", {}).get(signal)
        if left is not None:
            apart.append(Line(f"{name} residual".strip(), colour or DIFFERENCE, left.time_s, left.values))
    second = begins[-1] if len(named) > 1 else len(over) - 1  # of one run, its model
    second = second if 0 < second < len(over) else None
    return [
        Lines(title, unit, over, (second, 0) if second is not None else None),
        Lines("Residual", unit, apart, (1, 0) if len(apart) > 1 else None),
    ]
