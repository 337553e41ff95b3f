"""The actuator in its loop: command and load in, all signals out of the Monitor Model.

In an open loop the recorded current, torque or force is what is put in, and the motion alone is compared; or with a
voltage drive a recorded voltage or duty, and the motion and the current are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.commands import Recorded
from ema_model.commands.command import jumps
from ema_model.effects import find
from ema_model.errors import InputError
from ema_model.models.loop_window import BLOCK_S, COMPARED, LoopWindow, cut
from ema_model.models.measured_motion import check_steps, later, on_even_grid
from ema_model.models.model import Effects, ModelParts, Signals
from ema_model.physics.rows import LANES
from ema_model.recordings import Measurement
from ema_model.recordings.signals import least_noise, sample_noise
from ema_model.simulation.pack import initial_state, monitor_rows, own_stack, stack_at_hand
from ema_model.simulation.plant import simulate_references
from ema_model.simulation.run import Run, reference_steps, traced
from ema_model.stacks import Stack

Array = NDArray[np.float64]

LOAD = "constant_load"  # the effect through which a load that was not recorded acts
_CHUNK = 20_000  # blocks that are simulated at once


class ClosedLoop:
    """Recordings whose command and controller are known, or whose current or voltage is put in, cut into windows.

    Each starts from its own first sample.
    """

    def __init__(
        self,
        measurements: Sequence[Measurement],
        actuator: Actuator,
        *,
        effects: Mapping[str, Mapping[str, float]] | None = None,
        circuit: str = "reduced",
        own_kernels: bool = False,
        block_s: float = BLOCK_S,
        stretches: Sequence[list[slice] | None] | None = None,
        at_once: bool = True,
    ) -> None:
        """own_kernels: whether they are worth waiting for, instead of the library's in the meantime.

        at_once: whether what is wrong with recordings is said now; else once the windows are asked for.
        """
        if not measurements:
            raise InputError("one recording or more is needed")
        self.actuator = actuator
        self.simulates_commands = actuator.controller.kind != "open" or actuator.takes_voltage
        self.effects = {
            name: find(name, actuator.axes).settings(dict(given)) for name, given in (effects or {}).items()
        }
        self.recorded = list(measurements)  # before they were put on an even grid
        self._circuit, self._own_kernels, self._block_s, self._stretches = circuit, own_kernels, block_s, stretches
        if at_once:
            _ = self.stack, self.windows

    def made_of(self) -> ModelParts:
        """As in `Model`."""
        return ModelParts(
            self.recorded,
            self.actuator,
            self.effects,
            self._stretches,
            self._circuit,
            self._block_s,
            self._own_kernels,
        )

    @cached_property
    def stack(self) -> Stack:
        """As in `Model`."""
        if self._own_kernels:
            return own_stack(self.actuator, self.effects, self._circuit)
        return stack_at_hand(self.actuator, self.effects, self._circuit, "traces")

    @cached_property
    def measurements(self) -> list[Measurement]:
        """As in `Model`."""
        return [on_even_grid(m) for m in self.recorded]

    @cached_property
    def windows(self) -> list[LoopWindow]:
        """As in `Model`."""
        chosen = self._stretches or [None] * len(self.measurements)
        check_steps(self.measurements, chosen, self.actuator)
        return [
            window
            for i, (m, parts) in enumerate(zip(self.measurements, chosen))
            for window in cut(m, self.actuator, recording=i, block_s=self._block_s, stretches=parts)
        ]

    def at_longer_steps(self, most_s: float) -> Self:
        """As in `Model`."""
        longer = copy(self)
        longer.windows = [window.at_longer_steps(most_s) for window in self.windows]
        return longer

    def signals(
        self,
        place: int,
        actuator: Actuator | None = None,
        k: ArrayLike | None = None,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
        faster_rad_s: ArrayLike = 0.0,
        pull_Nm: ArrayLike = 0.0,
        effects: Effects | None = None,
        *,
        even: bool = False,
    ) -> Signals:
        """All of `COMPARED`, as in `Model`."""
        window = self.windows[place]
        if even:
            mean = np.full_like(window.load, window.load.mean())
            window = replace(window, load=mean, supply=np.ones_like(window.supply))
        return self._simulated(window, actuator, k, turned_rad, play_rad, faster_rad_s, pull_Nm, effects)

    def twins(
        self,
        place: int,
        actuator: Actuator,
        k: Array,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
        faster_rad_s: ArrayLike = 0.0,
        pull_Nm: ArrayLike = 0.0,
        effects: Effects | None = None,
    ) -> Signals:
        """As in `Model`."""
        window = self.windows[place]
        actuator = actuator.varied(window.values)
        if not actuator.has_reference_model:
            return {}
        load, others = _load_and_others(window, self.effects if effects is None else effects)
        run = _run(window)
        shown = simulate_references(
            run.command,
            run.samples,
            run.sample_rate_Hz,
            actuator,
            k,
            others,
            load_Nm=load,
            start_rad=window.user_rad + np.asarray(turned_rad) * actuator.transmission.gear_ratio,
            start_speed_rad_s=window.speed_rad_s + np.asarray(faster_rad_s),
            start_play_rad=window.play_rad + np.asarray(play_rad),
            start_integral_Nm=window.integral_Nm(actuator, k, turned_rad, play_rad, pull_Nm),
            start_time_s=window.begins_s,
            before=_before(window, run),
        )
        return self._measured(window, actuator, shown)

    def noise(self, place: int, stated: Mapping[str, float]) -> dict[str, float]:
        """As in `Model`; the longest run of the whole recording tells it."""
        window = self.windows[place]
        samples = self.recorded[window.recording]
        longest = max(samples.runs, key=lambda run: run.stop - run.start)
        each = {
            name: max(stated[name], least_noise(name)) if name in stated else sample_noise(samples[name][longest], name)
            for name in window.measured
        }
        return {name: one / np.sqrt(window.samples_per_block) for name, one in each.items()}

    def a_sample_late(self, place: int, k: ArrayLike | None = None) -> Signals:
        """As in `Model`."""
        window = self.windows[place]
        if not np.any(jumps(window.command)):
            return {}
        steps = window.steps_per_sample
        later = replace(window, command=np.concatenate([np.full(steps, window.command[0]), window.command[:-steps]]))
        now, then = (self._simulated(one, k=k) for one in (window, later))
        return {name: then[name][0] - now[name][0] for name in now}

    def turning(self, place: int, k: ArrayLike | None = None) -> Signals:
        """Nothing: the motion is the model's own."""
        return {}

    def between_samples(self, place: int, k: ArrayLike | None = None) -> Signals:
        """As in `Model`."""
        window = self.windows[place]
        if window.steps_per_sample == 1 or self.actuator.has_one_clock:
            return {}
        steps = window.steps_per_sample
        told = np.concatenate([window.before, window.command])
        straight = _straight(told, steps)
        first = len(window.before)
        other = replace(window, before=straight[:first], command=straight[first:])
        smooth, chords = (self._simulated(one, k=k) for one in (window, other))
        return {name: chords[name][0] - smooth[name][0] for name in smooth}

    def begun(
        self,
        window: LoopWindow,
        actuator: Actuator | None = None,
        k: ArrayLike | None = None,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
        faster_rad_s: ArrayLike = 0.0,
        pull_Nm: ArrayLike = 0.0,
        effects: Effects | None = None,
    ) -> tuple[Actuator, Array, Array]:
        """A window as kernels take it: the actuator as it was in it, its parameters and state, (blocks, rows·LANES).

        The others as in `signals`.
        """
        actuator = (actuator or self.actuator).varied(window.values)
        k = np.atleast_2d(np.asarray(actuator.k if k is None else k, dtype=float))
        if window.input == "motor_torque_Nm":  # which is put in as it is
            actuator = actuator.varied({"motor.torque_constant_Nm_A": 1.0})
        effects = self.effects if effects is None else effects
        if window.input == "motor_voltage_V":  # which is measured behind all that the supply does to it
            effects = {**effects, **_of_supply({**actuator.effects, **effects})}
        rows = monitor_rows(actuator, k, self.stack, effects)
        tau = actuator.transmission.gear_ratio
        state = initial_state(
            actuator,
            len(rows),
            window.user_rad + np.asarray(turned_rad) * tau,
            window.speed_rad_s + np.asarray(faster_rad_s),
            window.play_rad + np.asarray(play_rad),
            self.stack,
            window.integral_Nm(actuator, k, turned_rad, play_rad, pull_Nm),
            window.begins_s,
        )
        return actuator, rows, state

    def _simulated(
        self,
        window: LoopWindow,
        actuator: Actuator | None = None,
        k: ArrayLike | None = None,
        *moved: Any,
    ) -> Signals:
        """Of `signals`; moved: the rest of its arguments."""
        actuator, rows, state = self.begun(window, actuator, k, *moved)
        count = len(np.atleast_2d(np.asarray(actuator.k if k is None else k)))
        lanes = np.empty((4, count, window.blocks))
        steps = window.steps_per_block
        for first in range(0, window.blocks, _CHUNK):  # long recordings would fill the memory with lanes
            part = slice(first, min(first + _CHUNK, window.blocks))
            at = slice(part.start * steps, part.stop * steps)
            run = window.command[at], window.load[at], window.supply[at]
            period, group = window.steps_per_sample, window.samples_per_block
            before = window.before if first == 0 else window.before[:0]
            result = traced(self.stack, state, rows, run, period, group, window.step_s, before)
            for block, shown in enumerate(result):
                ours = lanes[:, block * LANES : (block + 1) * LANES, part]
                ours[...] = shown.transpose(1, 2, 0)[:, : ours.shape[1]]
        return self.sensed(dict(zip(COMPARED, lanes)), actuator, window.block_s)

    def _measured(self, window: LoopWindow, actuator: Actuator, shown: Signals) -> Signals:
        """Of a model's samples (n, samples) after the start, what was measured, as sensors show it: (n, blocks)."""
        blocks = {name: shown[name].reshape(len(shown[name]), -1, window.samples_per_block) for name in COMPARED}
        sensed = self.sensed({name: of.mean(axis=2) for name, of in blocks.items()}, actuator, window.block_s)
        return {name: sensed[name] for name in window.measured}

    def sensed(self, true: Signals, actuator: Actuator, block_s: float) -> Signals:
        """Signals (n, blocks) as the actuator's sensors show them."""
        sensors = actuator.sensors
        gain, bias = _each(sensors.current_gain), _each(sensors.current_bias_A)
        shown = true
        if np.any(gain != 1.0) or np.any(bias != 0.0):
            shown = {**true, "current_A": gain * true["current_A"] + bias}
        late = _each(sensors.delay_s) - self.actuator.sensors.delay_s  # beyond what the window's command has
        return {name: later(values, late, block_s) for name, values in shown.items()}


def _run(window: LoopWindow) -> Run:
    """A window as a run of the Reference Model."""
    return Run(
        Recorded(np.arange(len(window.command)) * window.step_s, window.command),
        duration_s=len(window.command) * window.step_s,
        sample_rate_Hz=1.0 / (window.steps_per_sample * window.step_s),
    )


def _straight(command: Array, steps: int) -> Array:
    """A command (n,) that goes straight from sample to sample, of so many steps each, but where it jumps."""
    samples = np.arange(0, len(command), steps)
    values = command[samples]
    straight = np.interp(np.arange(len(command)), samples, values)
    straight[samples[-1] :] = command[samples[-1] :]
    jumped = np.append(jumps(values), False).repeat(steps)[: len(command)]
    return np.where(jumped, command, straight)


def _before(window: LoopWindow, run: Run) -> Array:
    """What the drive was told before a window, at the steps at which the Reference Model of a run is told it."""
    dt = reference_steps(run)[2]
    lead_s = len(window.before) * window.step_s
    at = np.arange(round(lead_s / dt)) * dt
    told = np.append(window.before, window.command[0])
    return np.interp(at, np.arange(len(told)) * window.step_s, told)


def _load_and_others(window: LoopWindow, effects: Effects) -> tuple[Array, Effects]:
    """The constant load, N·m, of the recording and of the effects, which needs no kernel of its own; and the others."""
    pull = effects.get(LOAD, {"torque_Nm": 0.0})["torque_Nm"]
    others = {name: settings for name, settings in effects.items() if name != LOAD}
    return window.load.mean() + np.asarray(pull), others


def _of_supply(effects: Effects) -> Effects:
    """Of the effects, those that act on the bus voltage alone, with settings that do nothing."""
    return {
        name: find(name).neutral
        for name in effects
        if {place.__name__ for place in find(name).places} == {"bus_voltage"}
    }


def _each(value: ArrayLike) -> Array:
    """One number, or one for each individual, as a column."""
    return np.atleast_1d(np.asarray(value, dtype=float))[:, None]
