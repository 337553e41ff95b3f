"""Discoveries of a few candidates on short recordings, so that what shows them can be tested in seconds."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.discovery import Discovery, discover
from ema_model.recordings import Measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

HIDDEN = {"cogging_torque": {"amplitude_Nm": 0.02, "order": 12.0, "phase_rad": 0.7}}
_RUNS = {
    "sine": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5),
    "a|b <script>": Run(command("chirp"), 0.3),
}
_UNSEEN = Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5.0}), 0.3)


@cache
def with_cogging() -> Discovery:
    """Cogging found and added, in two recordings, with one held out."""
    recordings = [_recorded(name, run, i) for i, (name, run) in enumerate(_RUNS.items())]
    found = discover(
        recordings,
        holdout=[_recorded("unseen", _UNSEEN, 9)],
        candidates=("cogging_torque", "constant_load", "dead_time"),
        most_effects=1,
    )
    assert [one.name for one in found.effects] == ["cogging_torque"]
    return found


@cache
def with_unknown() -> Discovery:
    """The same plant where cogging is not among the candidates; nothing held out."""
    found = discover([_recorded("sine", _RUNS["sine"], 0)], candidates=("dead_time",))
    assert found.verdict == "unknown_effect" and found.unknown is not None
    return found


def _recorded(name: str, run: Run, seed: int) -> Measurement:
    recording = Sensors(0.3, 12).record(simulate_reference(run, load_actuator(), effects=HIDDEN), seed)
    return replace(recording, name=name)
