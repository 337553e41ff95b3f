"""A run with an effect beside the same run without: what the effect does, and which signal and run show it most."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import WITHOUT_LOOP
from ema_model.commands import command
from ema_model.effects import Effect, find
from ema_model.errors import InputError
from ema_model.recordings import Measurement
from ema_model.simulation.compiled import is_compiled, stack_at_hand
from ema_model.simulation.run import Run, simulate_monitor

Array = NDArray[np.float64]

SHOWN = ("current_A", "user_position_rad", "motor_speed_rad_s")
RUNS: dict[str, Run] = {
    "sine of 3 Hz": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5),
    "sine of 3 Hz, loaded": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5, 10_000.0, 200.0),
    "step": Run(command("step", {"final_rad": 0.005}), 0.2),
    "chirp": Run(command("chirp"), 0.5),
}
_SATURATED = "step"  # where the drive stands at its limits, so that a small effect shifts the whole transient
_LEAST = 1e-3  # of a signal's range, rms
_TURN = 2.0 * np.pi
_PERIODS, _LONG_PERIODS = 3, 2  # that are shown; of a period as long as a turn


@dataclass(frozen=True, eq=False)
class WithEffect:
    """What an effect does in a run."""

    name: str
    run: str
    settings: Mapping[str, float]
    with_it: Measurement
    without: Measurement

    def change(self, name: str) -> tuple[float, Array]:
        """What changes in a signal, (samples,), and its rms as a share of the signal's range; 0 for next to nothing."""
        share, change = self._share(name)
        return (share if share > _LEAST else 0.0), change

    def _share(self, name: str) -> tuple[float, Array]:
        change = self.with_it[name] - self.without[name]
        return float(np.sqrt(np.mean(change**2))) / (float(np.ptp(self.without[name])) or 1.0), change

    def against(self, variable: str) -> Array:
        """A variable of `ema_model.quantities.VARIABLES` in the run with the effect, (samples,), in its unit.

        KeyError for one that no run has: a temperature.
        """
        run = self.with_it
        if variable == "acceleration":
            return np.gradient(run["motor_speed_rad_s"], run.time_s)
        if variable == "load":
            return run.get("load_torque_Nm", np.zeros(run.samples))
        return run[_SIGNALS[variable]]

    @property
    def shows(self) -> str:
        """The signal that shows it most."""
        return max(SHOWN, key=lambda name: self.change(name)[0])

    @property
    def visibility(self) -> float:
        """How much of that signal's range changes, rms."""
        return self.change(self.shows)[0]

    @property
    def trace(self) -> float:
        """The same where that is next to nothing."""
        return max(self._share(name)[0] for name in SHOWN)


_SIGNALS = {
    "motor_angle": "motor_position_rad",
    "user_position": "user_position_rad",
    "motor_speed": "motor_speed_rad_s",
    "current": "current_A",
    "time": "time_s",
}


def few_periods(settings: Mapping[str, float]) -> tuple[float, int]:
    """The angle over which an effect with these settings repeats a few times, rad (m of a linear motor), and how often.

    By its order or its period; what has neither repeats once a turn.
    """
    period = settings.get("period_rad", _TURN / settings.get("order", 1.0))
    count = _PERIODS if period < 0.99 * _TURN else _LONG_PERIODS
    return count * period, count


class EffectRuns:
    """An actuator's effects in `RUNS`; the runs without them are simulated once."""

    def __init__(self, actuator: Actuator) -> None:
        self.actuator = actuator
        self._without: dict[str, Measurement] = {}

    def is_compiled(self, name: str) -> bool:
        """Whether a run with that effect begins at once; else its kernel is compiled first."""
        if self.actuator.controller.kind in WITHOUT_LOOP:
            return True  # it is refused at once
        return is_compiled(stack_at_hand(self.actuator, {name}, "reduced", "traces"), "traces")

    def felt(self, name: str, settings: Mapping[str, float], run: str) -> WithEffect:
        """With and without, by the Monitor Model; InputError where the actuator does not stand the effect."""
        try:
            if run not in self._without:
                self._without[run] = simulate_monitor(RUNS[run], self.actuator)
            with_it = simulate_monitor(RUNS[run], self.actuator, effects={name: dict(settings)})
        except FloatingPointError as error:
            raise InputError(f"{find(name).title}: {error}; make it weaker") from None
        return WithEffect(name, run, dict(settings), with_it, self._without[run])

    def clearest(self, effect: Effect) -> WithEffect | None:
        """An effect at its clear severity in the run that shows it most; None where the actuator stands none.

        What follows a variable is looked for in the saturated run last, and what repeats with the motor's angle in runs
        that go through some periods; where none shows it, the largest trace counts.
        """
        found: list[WithEffect] = []
        for run in RUNS:
            with suppress(InputError):
                found.append(self.felt(effect.name, effect.at_severity(1), run))

        def rank(felt: WithEffect) -> tuple[bool, float, float]:
            fits = effect.against == "time" or felt.run != _SATURATED
            if effect.against == "motor_angle":
                fits &= float(np.ptp(felt.against("motor_angle"))) > few_periods(felt.settings)[0]
            return fits and felt.visibility > 0.0, felt.visibility, felt.trace

        return max(found, key=rank, default=None)

    def severities(self, effect: Effect) -> list[WithEffect]:
        """An effect when slight, clear and strong, in the run of `clearest`; none where the actuator stands none.

        Raises InputError where it does not stand the effect when that is strong.
        """
        clear = self.clearest(effect)
        if clear is None:
            return []
        slight, strong = (self.felt(effect.name, effect.at_severity(i), clear.run) for i in (0, 2))
        return [slight, clear, strong]
