"""An effect whose every strength makes the loop unstable has no fingerprint; it is no candidate, and no overflow."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.discovery import fingerprints
from ema_model.discovery.history import begun
from ema_model.discovery.terms import hidden, noise_of, settings_at, terms_of
from ema_model.effects import find
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
    assert {*hidden(story.current, prints)} == {"constant_load", "cogging_torque"}
    noise = noise_of(story.data, story.current)
    assert not [one for one in terms_of(story.data, story.current, prints, noise, [12]) if one.fingerprint]


def test_speeds_are_looked_for_at_shares_of_the_recordings_top_speed():
    effect = find("stribeck_friction")
    usual = [one["speed_rad_s"] for [one] in fingerprints.variants(effect, [])]
    slow = [one["speed_rad_s"] for [one] in fingerprints.variants(effect, [], 3.0)]
    assert usual == list(effect.severities)
    assert slow[: len(usual)] == usual and sorted(slow)[:2] == pytest.approx([0.3, 0.9])
    constant = fingerprints.variants(find("constant_load"), [], 3.0)
    assert [one["torque_Nm"] for [one] in constant] == list(find("constant_load").severities)


def test_a_part_of_another_kind_is_a_column_of_its_own():
    """Friction may differ by direction in its viscous part alone."""
    effect = find("asymmetric_friction")
    both = fingerprints.variants(effect, [])[1]
    assert both == [{"ratio": 0.12}, {"ratio": 0.0, "viscous_part_Nms_rad": pytest.approx(5e-5)}]
    one = fingerprints.Fingerprint(effect.name, both[0], np.zeros((1, 2)), {"viscous_part_Nms_rad": 5e-5})
    settings = settings_at(SimpleNamespace(actuator=load_actuator()), one, np.array([0.5, 3.0]))
    assert settings == pytest.approx({"ratio": 0.06, "viscous_part_Nms_rad": 1.5e-4})
