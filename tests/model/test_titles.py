"""Names in words: of every parameter and setting that a person meets."""

from __future__ import annotations

from dataclasses import fields

import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import COMMANDS
from ema_model.effects import CATALOGUE
from ema_model.quantities import in_sentence, labelled, parameter_title, unit_of
from ema_model.recordings import SIGNALS


@pytest.mark.parametrize(
    ("path", "title", "unit"),
    [
        ("motor.inertia_kgm2", "Motor inertia", "kg·m²"),
        ("transmission.stiffness_Nm_rad", "Transmission stiffness", "N·m/rad"),
        ("controller.gain_1_rad", "Controller gain", "1/rad"),
        ("frequency_Hz", "Frequency", "Hz"),
        ("delay_s", "Delay", "s"),
        ("motor.mass_kg", "Motor mass", "kg"),
        ("motor.pole_pairs", "Motor pole pairs", ""),
        ("play 0", "Play 0", ""),
    ],
)
def test_a_name_ends_with_its_unit(path, title, unit):
    assert (parameter_title(path), unit_of(path)) == (title, unit)


def test_a_title_within_a_sentence_keeps_its_letters_and_proper_names():
    assert in_sentence(SIGNALS["phase_a_current_A"].title) == "phase A current"
    assert in_sentence("RMS current") == "RMS current"
    assert in_sentence(CATALOGUE["stribeck_friction"].title) == "Stribeck friction"
    assert in_sentence("Motor inertia") == "motor inertia"


def test_the_unit_of_each_setting_and_parameter_is_told():
    names = [parameter.name for effect in CATALOGUE.values() for parameter in effect.parameters]
    names += [f.name for command in COMMANDS.values() for f in fields(command)]
    names += load_actuator().tolerances
    for name in names:
        letters = name.rpartition(".")[2].replace("_", "")
        assert letters.islower() or unit_of(name), f"{name} is shown as {labelled(name)}"
