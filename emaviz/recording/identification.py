"""Identifications as recordings: one with how its search went, and k over the flights of a unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike, NDArray

from ema_model import faults
from ema_model.actuator.actuator import between, sentences
from ema_model.commands import Recorded
from ema_model.errors import InputError
from ema_model.identification.run import (
    Identification,
    Progress,
    algorithm_title,
    facts,
    in_one_line,
    verdict,
    why_best,
)
from ema_model.identification.search import Objective
from ema_model.quantities import HALF_90, amount
from ema_model.recordings import Measurement
from ema_model.simulation.run import RecordedLoad, Run, simulate_monitor
from ema_model.tracking.track import Tracked
from emaviz.recording import writer as drawn_as
from emaviz.recording.blueprint import plot
from emaviz.recording.entry import GROUP_COLOURS, K_TITLES, RecordingError
from emaviz.recording.writer import RecordingWriter, escaped

# --- an identification: what was measured, how the search went, what it found -----------------------------------------

_RESIDUAL = ("current_A", "user_position_rad", "motor_position_rad", "motor_speed_rad_s")
_FITTED = ("command_rad", "user_position_rad", "motor_position_rad", "motor_speed_rad_s", "current_A")
_SHOWN = ("current_A", "user_position_rad")  # on the dashboard
_EACH_UNTIL, _THEN_EVERY = 20, 5  # iterations whose best model is drawn, where it has changed
_LONGEST_S = 3.0  # of a measurement of which every iteration's model is simulated


class IdentificationStory:
    """Writes one identification while it runs; a failure to write never reaches the search."""

    def __init__(
        self,
        path: str | Path,
        objective: Objective,
        measurement: Measurement,
        source: str,
        truth: NDArray[np.float64] | None,
        configuration: Mapping[str, Any],
        algorithms: Sequence[str] = (),
    ) -> None:
        """source: "reference" for a simulated actuator, "measurement" for a recording.

        algorithms: those that will tell their iterations; with them the file is arranged from the start.
        """
        self.path = Path(path)
        self._writer = RecordingWriter(path)
        self._fits: list[str] = []  # signals drawn beside each iteration's model
        self._drawn: dict[str, NDArray[np.float64]] = {}  # the k that was drawn last, by algorithm
        self._last: dict[str, int] = {}  # iteration, by algorithm
        self._outside = objective.actuator.axes.outside  # the names that files have
        self._objective = objective
        self._measurement = measurement
        self._source = source
        self._configuration = dict(configuration)
        self._writer.config(_configuration(configuration))
        self._writer.signals(source, measurement.time_s, self._outside(_signals(measurement)))
        if truth is not None:
            self._writer.truth(truth)
        if algorithms:
            self._begin_fits(algorithms)
            residual = [name for name in _RESIDUAL if name in measurement]
            groups = {source: _signals(measurement), "monitor": _FITTED, "residual": residual}
            expected = {group: list(self._outside(dict.fromkeys(names))) for group, names in groups.items()}
            self._writer.expect(expected, algorithms)

    @property
    def failed(self) -> str | None:
        """Why nothing more is written, if so."""
        return self._writer.failed

    def iteration(self, at: Progress) -> None:
        """One iteration: convergence, best k, population, and the best model's curves where that has changed."""
        self._writer.iteration(at.algorithm, at.iteration, at.rmse, at.k, at.population, at.population_rmse)
        self._last[at.algorithm] = at.iteration
        due = at.iteration <= _EACH_UNTIL or at.iteration % _THEN_EVERY == 0 or at.iteration == at.iterations
        drawn = self._drawn.get(at.algorithm)
        if self._fits and due and (drawn is None or not np.array_equal(drawn, at.k)):
            self._drawn[at.algorithm] = at.k.copy()
            self._draw_fit(at.algorithm, at.iteration, at.k)

    def _begin_fits(self, algorithms: Sequence[str]) -> None:
        """The measured curves, beside which each iteration's model is drawn."""
        for name in _SHOWN:
            if name in self._measurement:
                self._writer.fit(self._named(name), self._measurement.time_s, self._measurement[name], algorithms)
                self._fits.append(name)
        for name in (name for name in _RESIDUAL if name in self._measurement):
            self._writer.curve(self._named(name), "measured", self._measurement.time_s, self._measurement[name])

    def _draw_fit(self, algorithm: str, index: int, k: NDArray[np.float64]) -> None:
        if self._measurement.duration_s > _LONGEST_S and index:
            return  # a simulation of it would hold the search up
        model = self._fitted(k)
        for name in self._fits:
            self._writer.fit_iteration(algorithm, index, self._named(name), model.time_s, model[name])

    def _named(self, name: str) -> str:
        """A signal's name as files have it."""
        return next(iter(self._outside({name: None})))

    def finish(self, best: Identification, *others: Identification) -> None:
        """The fitted monitor and the residual of the best answer, the result of each; closes the file."""
        monitor = self._fitted(best.k)
        time = self._measurement.time_s
        self._writer.signals("monitor", time[: monitor.samples], self._outside(_signals(monitor)))
        residual = {
            name: monitor[name] - self._measurement[name][: monitor.samples]
            for name in _RESIDUAL
            if name in self._measurement
        }
        self._writer.signals("residual", time[: monitor.samples], self._outside(residual))
        for name in (name for name in _RESIDUAL if name in self._measurement):
            self._writer.curve(self._named(name), "model", monitor.time_s, monitor[name])
        self._writer.answer(_in_words(best, others))
        for answer in (best, *others):
            if self._fits and answer.algorithm in self._last:
                last = self._last[answer.algorithm] + 1  # the answer stands one on: it is a fit from there
                model = monitor if answer is best else self._fitted(answer.k)
                for name in self._fits:
                    self._writer.fit_iteration(answer.algorithm, last, self._named(name), model.time_s, model[name])
                self._writer.iteration(answer.algorithm, last, answer.rmse, answer.k)
                self._writer.interval(answer.algorithm, last, answer.uncertainty.interval90)
            if len(answer.corrected_history):
                self._writer.corrected(answer.algorithm, [*answer.corrected_history, answer.corrected_rmse])
            self._writer.result(_result(answer, self._objective), answer.algorithm)
        found = {answer.algorithm: _facts(answer) for answer in (best, *others)}
        self._writer.properties({"settings": self._configuration, "found": found, "best": best.algorithm})
        self.close()

    def close(self) -> None:
        """Closes the file as it is."""
        self._writer.close()

    def _fitted(self, k: NDArray[np.float64]) -> Measurement:
        """The monitor's signals at this k (8,), on the recording's own time base."""
        m = self._measurement
        load = m.get("load_torque_Nm")
        heaviest = 0.0 if load is None else float(np.max(np.abs(load)))
        shares = None if load is None or not heaviest else RecordedLoad(m.time_s, load / heaviest)
        run = Run(
            Recorded(m.time_s, m["command_rad"]),
            duration_s=m.duration_s,
            sample_rate_Hz=1.0 / m.sample_period_s,
            load_torque_Nm=heaviest,
            **({} if shares is None else {"load": shares}),
        )
        objective = self._objective
        return simulate_monitor(
            run,
            objective.actuator,
            k,
            objective.effects,
            objective.stack.circuit,
            start_rad=objective.windows[0].user_rad,
        )


def _signals(measurement: Measurement) -> dict[str, NDArray[np.float64]]:
    return {name: values for name, values in measurement.signals.items() if name != "time_s"}


def _in_words(best: Identification, others: Sequence[Identification]) -> str:
    """The answer as the dashboard shows it."""
    phrases = between(best.k, best.uncertainty.interval90, best.actuator)
    told = best.uncertainty.adequate
    rows = [
        f"| {'**' + name + '**' if name in best.uncertainty.alarms else name} | {phrase if told else '–'} |"
        for name, phrase in zip(faults.NAMES, phrases)
    ]
    more = [f"\n★ {algorithm_title(best.algorithm)}: {why_best(best, others)}"] if others else []
    facts_line = " · ".join(facts(best))
    return "\n".join([f"# {in_one_line(best)}", "", facts_line, *more, "", "| k | 90 % |", "|---|---|", *rows])


def _configuration(configuration: Mapping[str, Any]) -> str:
    rows = "\n".join(f"| {name} | `{value}` |" for name, value in configuration.items() if value not in (None, [], ""))
    return f"# Identification\n\n| setting | value |\n|---|---|\n{rows}\n"


def _result(answer: Identification, objective: Objective) -> dict[str, Any]:
    sure = answer.uncertainty
    result: dict[str, Any] = {
        name: f"{answer.k[i]:.4f}  ({sure.interval90[i, 0]:.4f} … {sure.interval90[i, 1]:.4f})  — {phrase}"
        for i, (name, phrase) in enumerate(zip(faults.NAMES, sentences(answer.k, objective.actuator)))
    }
    result |= {
        "verdict": verdict(answer),
        "corrected error": amount(answer.corrected_rmse, "A"),
        "evaluations": answer.evaluations,
        "time": f"{answer.elapsed_s:.2f} s" + (" (stopped)" if answer.stopped else ""),
        "seed": answer.seed,
    }
    if answer.error_percent is not None:
        result["Err (T 5.2)"] = f"{answer.error_percent:.2f} %"
    return result


def _facts(answer: Identification) -> dict[str, Any]:
    """What a list of recordings shows, and a comparison of two needs."""
    sure = answer.uncertainty
    return {
        "k": answer.k,
        "k_interval90": sure.interval90,
        "rmse_A": answer.rmse,
        "corrected_rmse_A": answer.corrected_rmse,
        "error_percent": answer.error_percent,
        "evaluations": answer.evaluations,
        "elapsed_s": answer.elapsed_s,
        "healthy": bool(sure.healthy),
        "alarms": list(sure.alarms),
        "stopped": answer.stopped,
    }


# --- k over the flights of a unit, on the timeline `flight` -----------------------------------------------------------

FLIGHT = "flight"
ROOT = "/track"
_MOST_AHEAD = 400.0  # flights, to which the way to the threshold is drawn


def write_tracking(result: Tracked, path: str | Path, configuration: Mapping[str, Any] | None = None) -> None:
    """Writes a whole .rrd file; InputError in one line where that cannot be done."""
    try:
        with TrackingWriter(path, result) as writer:
            writer.properties({"track": result.to_dict(), "configuration": dict(configuration or {})})
            writer.answer()
            for name in result.faults:
                writer.fault(name)
    except RecordingError as error:
        raise InputError(str(error)) from None
    if writer.failed is not None:
        raise InputError(writer.failed)


class TrackingWriter(RecordingWriter):
    """A recording of a unit's flights: each k with its band, its threshold, and the way that remains."""

    def __init__(self, path: str | Path, result: Tracked) -> None:
        super().__init__(path)
        self._result = result
        self._at = np.array([i for i, one in enumerate(result.flights, 1) if not one.excluded])

    def __enter__(self) -> TrackingWriter:
        return self

    def answer(self) -> None:
        """What it says in words."""
        text = self._result.document.text
        with self._file.lock:
            self._text(f"{ROOT}/answer", "\n".join(f"    {escaped(line)}" for line in text.splitlines()))

    def fault(self, name: str) -> None:
        """One k."""
        one, colours = self._result.faults[name], GROUP_COLOURS
        self._line(f"{name}/k", f"{name} identified", colours["reference"], self._at, one.k)
        for side, sign in (("low", -1.0), ("high", 1.0)):
            band = one.k + sign * HALF_90 * one.sigma
            self._line(f"{name}/{side}", f"{name} 90 % {side}", colours["floor_low"], self._at, band)
        now = len(self._result.flights)
        ahead = 0.0
        if one.remaining_flights is not None and one.threshold is not None:
            ahead = min(one.remaining_flights.p95, _MOST_AHEAD)
            for share, flights in (
                ("p05", one.remaining_flights.p05),
                ("p50", one.remaining_flights.p50),
                ("p95", one.remaining_flights.p95),
            ):
                reach = min(flights, _MOST_AHEAD) / max(flights, 1e-9)
                times = np.array([now, now + max(1, round(reach * flights))])
                values = [one.level, one.level + reach * (one.threshold - one.level)]
                self._line(f"{name}/{share}", f"{name} to the threshold, {share}", colours["residual"], times, values)
        if one.threshold is not None:
            times = np.array([1, now + max(1, round(ahead))])
            self._line(f"{name}/threshold", f"{name} threshold", colours["monitor"], times, [one.threshold] * 2)

    def _line(self, place: str, title: str, colour: Any, at: ArrayLike, values: ArrayLike) -> None:
        time = [rr.TimeColumn(FLIGHT, sequence=np.asarray(at, dtype=np.int64))]
        self._send(f"{ROOT}/{place}", drawn_as.line(title, colour, 1.5), time, np.asarray(values, dtype=float))

    def _layout(self) -> rrb.Blueprint:
        views = [plot(K_TITLES[name], [f"{ROOT}/{name}/**"], legend=False) for name in self._result.faults]
        words = rrb.TextDocumentView(origin=f"{ROOT}/answer", name="Answer")
        return rrb.Blueprint(
            rrb.Vertical(words, rrb.Grid(*views, name="k over flights"), row_shares=[1, 2]),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            rrb.TimePanel(state="collapsed", timeline=FLIGHT, play_state="Paused"),
            auto_views=False,
            auto_layout=False,
        )
