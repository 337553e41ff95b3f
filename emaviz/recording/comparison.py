"""A comparison told as a recording: measured, model, residual and floor, where it fails, and how it was compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.regions import worst_moment
from ema_model.comparison.result import Compared, Comparison, as_dict, details, verdict
from ema_model.errors import InputError
from ema_model.estimation.calibrate import convergence, warnings
from ema_model.estimation.floor import BAND_SIGMAS
from ema_model.text import Lines, Note
from emaviz.recording.entry import RecordingError, configured
from emaviz.recording.style import COMPARISON, plain
from emaviz.recording.writer import RecordingWriter, written

Array = NDArray[np.float64]

_PAUSE_S = 0.2  # between recordings, so that one is seen to end


def write_comparison(comparison: Comparison, path: str | Path, configuration: Mapping[str, Any] | None = None) -> None:
    """Writes a whole .rrd file; InputError in one line where that cannot be done.

    Several recordings stand one after another on sim_time, because then every signal has the one path that scripts
    know, and one view shows all of it; the configuration says where each begins.  A signal that was compared is
    there in the block means it was compared by, the others as they were recorded; of a recording whose time starts
    anew in between only those that were compared.
    """
    try:
        with ComparisonWriter(path) as writer:
            times, shifts = _one_after_another(comparison.recordings)
            writer.config(_configuration(comparison, times, shifts, configuration or {}))
            writer.properties({"comparison": as_dict(comparison), "shift_s": shifts})
            for group, signals in _groups(comparison).items():
                for name, values in signals.items():
                    _write(writer, group, name, times, values)
            raw = [_sample_times(one, shift) for one, shift in zip(comparison.recordings, shifts)]
            for name in _not_compared(comparison):
                values = [one.measurement.get(name) for one in comparison.recordings]
                _write(writer, "measurement", name, raw, values)
            writer.finding("answer", written(f"The model is {verdict(comparison)}", comparison.document.blocks))
            writer.finding("regions", _regions(comparison, times))
    except RecordingError as error:
        raise InputError(str(error)) from None
    if writer.failed is not None:
        raise InputError(writer.failed)


class ComparisonWriter(RecordingWriter):
    """A recording that also holds what a comparison found, in words."""

    def __enter__(self) -> ComparisonWriter:
        return self

    def finding(self, name: str, text_markdown: str) -> None:
        """A document at /comparison/NAME, shown where it fails."""
        with self._file.lock:
            if plain(name) not in self._contents.findings:
                self._contents.findings.append(name)
            self._text(f"{COMPARISON}/{name}", text_markdown)


def _one_after_another(recordings: Sequence[Compared]) -> tuple[list[Array], list[float]]:
    """Times of each recording's blocks on sim_time, s, and what was added to them; the first keeps its own.

    A run that starts anew within a recording follows the run before it.
    """
    times, shifts = [], []
    end = None
    for one in recordings:
        time = one.time_s.copy()
        for at in np.flatnonzero(np.diff(time) <= 0.0) + 1:
            time[at:] += time[at - 1] + _PAUSE_S - time[at]
        shift = 0.0 if end is None else end + _PAUSE_S - float(min(time[0], one.measurement.time_s[0]))
        times.append(time + shift)
        shifts.append(shift)
        end = float(max(times[-1][-1], one.measurement.time_s[-1] + shift))
    return times, shifts


def _sample_times(one: Compared, shift: float) -> Array | None:
    """Times of the samples; None where runs start anew, as which blocks they belong to is then not known."""
    time = one.measurement.time_s
    return time + shift if np.all(np.diff(time) > 0.0) else None


def _groups(comparison: Comparison) -> dict[str, dict[str, list[Array | None]]]:
    """By group and signal, the values of each recording, None where it lacks the signal; the primary signal first."""
    names = sorted(comparison.signals, key=lambda name: name != comparison.primary)
    calibrated = comparison.calibration is not None

    def residual(one: Compared, name: str) -> Array:
        return one.measured[name] - one.model[name]

    of = {
        "measurement": lambda one, name: one.measured[name],
        "monitor": lambda one, name: one.model[name],
        **({"initial": lambda one, name: one.initial[name]} if calibrated else {}),
        "residual": residual,
        "floor_high": lambda one, name: BAND_SIGMAS * one.sigma[name],
        "floor_low": lambda one, name: -BAND_SIGMAS * one.sigma[name],
    }
    return {
        group: {
            name: [take(one, name) if name in one.measured else None for one in comparison.recordings] for name in names
        }
        for group, take in of.items()
    }


def _write(
    writer: ComparisonWriter,
    group: str,
    name: str,
    times: Sequence[Array | None],
    values: Sequence[Array | None],
) -> None:
    """The recordings' values one after another, without what is no number: it would stop the plot's lines."""
    known = [(t, v) for t, v in zip(times, values, strict=True) if t is not None and v is not None]
    if not known:
        return
    time, joined = np.concatenate([t for t, _ in known]), np.concatenate([v for _, v in known])
    finite = np.isfinite(joined)
    writer.signals(group, time[finite], {name: joined[finite]})
    steps = np.diff(time[finite])
    if not len(steps):
        return
    for at in np.flatnonzero(steps > max(0.99 * _PAUSE_S, 5.0 * float(np.median(steps)))):
        writer.gap(group, name, float(time[finite][at]) + 0.5 * float(steps[at]))


def _not_compared(comparison: Comparison) -> list[str]:
    """Recorded signals that were not compared."""
    names = dict.fromkeys(name for one in comparison.recordings for name in one.measurement.signals)
    return [name for name in names if name != "time_s" and name not in comparison.signals]


def _regions(comparison: Comparison, times: Sequence[Array]) -> str:
    if not comparison.worst_regions:
        return written("Worst regions", [Lines(["No region stands out of the floor."])])
    time = np.concatenate(times)
    told = []
    for region in comparison.worst_regions:
        _, at = worst_moment(comparison.residuals, region)
        told.append(Lines([details(comparison, region), f"Worst at {time[at]:.4g} s."], region.sentence))
    return written("Worst regions", told)


def _configuration(
    comparison: Comparison, times: Sequence[Array], shifts: Sequence[float], configuration: Mapping[str, Any]
) -> str:
    settings = {"actuator": comparison.actuator.name, **configuration}
    settings["block"] = f"{1e3 * comparison.residuals.block_s:.4g} ms"
    said = configured(settings, [one.name for one in comparison.recordings], times, shifts)
    fit, axes = comparison.calibration, comparison.actuator.axes
    told = [] if fit is None else [Lines([convergence(fit)]), *map(Note, warnings(fit, axes))]
    return written("Comparison", [said, *told])
