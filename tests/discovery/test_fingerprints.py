"""An effect whose every strength makes the loop unstable has no fingerprint; it is no candidate, and no overflow."""

from __future__ import annotations

import numpy as np

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.discovery.candidates import fingerprints
from ema_model.discovery.candidates.score import scored
from ema_model.discovery.begin import begun
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference


def test_what_diverges_at_every_strength_cannot_be_shown(monkeypatch):
    actuator = load_actuator()
    recording = Sensors(0.3, 12).record(simulate_reference(Run(command("chirp"), 0.1), actuator), 0)
    story = begun([recording], actuator)
    values = len(story.current.residual)
    strange = np.array([1e200, np.inf, np.nan, -1e180])[np.arange(values) % 4]
    monkeypatch.setattr(fingerprints, "_changes", lambda data, found, lanes: np.tile(strange, (len(lanes), 1)))
    prints = fingerprints.fingerprints(story.data, story.current, ["constant_load", "cogging_torque"], [12])
    assert all(np.all(one.columns == 0.0) for one in prints)
    assert all(one.predicted_drop == 0.0 and one.untestable_reason for one in scored(story.current, prints))
