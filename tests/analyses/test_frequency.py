"""Frequency response: known resonances, damping and delays are found; what excites nothing is told nothing of."""

from __future__ import annotations

import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from support.flexible_drive import LOAD, MOTOR, flexible_drive
from support.unknown_drive import drive_of

import ema_model as em
from ema_model.analyses import analyses
from ema_model.analyses.frequency import FrequencyResponse, analyse
from ema_model.errors import InputError
from ema_model.recordings import Measurement
from ema_model.result import described, json_type

SWEEP = {"amplitude_rad": 2e-3, "end_Hz": 100.0, "end_time_s": 6.0}


def swept(**more) -> Measurement:
    return em.simulate("chirp", settings=SWEEP, duration_s=6.0, noise_A=0.1, **more)


@pytest.fixture(scope="module")
def flexible(tmp_path_factory) -> FrequencyResponse:
    return analyse([flexible_drive(3, 22.0)], drive_of(tmp_path_factory.mktemp("drive"), False))


@pytest.mark.parametrize(
    ("seed", "antiresonance_Hz", "damping"),
    [(3, 22.0, 0.02), *(pytest.param(*one, marks=pytest.mark.long) for one in ((4, 14.0, 0.01), (5, 30.0, 0.05)))],
)
def test_two_masses_are_told_with_their_damping(tmp_path, seed, antiresonance_Hz, damping):
    """Simulated by another program; a single sweep with noise, and an encoder of 2,600 counts in a radian."""
    recording = flexible_drive(seed, antiresonance_Hz, damping=damping)
    found = analyse([recording], drive_of(tmp_path, False))
    stretch = np.sqrt(1.0 + LOAD / MOTOR)
    for mode, frequency, ratio in (
        (found.measured.antiresonance, antiresonance_Hz, damping),
        (found.measured.resonance, antiresonance_Hz * stretch, damping * stretch),
    ):
        assert mode.frequency_Hz.value == pytest.approx(frequency, rel=0.02)
        assert abs(mode.frequency_Hz.value - frequency) < 2.0 * mode.frequency_Hz.half
        low, high = mode.damping.interval90
        assert low / 1.5 < ratio < 1.5 * high
    assert found.model.resonance is None and found.model.antiresonance is None, "the model has one mass"
    assert found.answer[0] == str(found).splitlines()[0] and "the model has none in this band" in found.answer[0]


def test_several_recordings_are_averaged_together(tmp_path, flexible):
    both = analyse([flexible_drive(seed, 22.0) for seed in (3, 4)], drive_of(tmp_path, False))
    assert both.recordings == ("sweep", "sweep")
    assert both.measured.resonance.frequency_Hz.value == pytest.approx(38.1, rel=0.01)
    assert both.band.sum() * both.averages > flexible.band.sum() * flexible.averages


def test_a_delay_of_the_command_is_told(tmp_path):
    found = analyse([swept(effects={"goal_delay": {"delay_s": 4e-3}})], em.load_actuator())
    ours, model = found.measured.delay_s, found.model.delay_s
    assert ours.value - model.value == pytest.approx(4e-3, abs=1e-4) and ours.differs(model, least=found.sample_s)
    assert "The measured delay is 4.2" in found.answer[0]


@pytest.mark.long
def test_a_model_that_has_the_compliance_answers_as_was_measured():
    recording = swept(effects={"torsional_compliance": {}})
    rigid = em.load_actuator()
    without = analyse([recording], rigid)
    assert 55.0 < without.measured.resonance.frequency_Hz.value < 75.0 and without.model.resonance is None
    assert without.differs and without.differs[0].most_dB > 6.0
    effects = {**rigid.effects, "torsional_compliance": em_settings("torsional_compliance")}
    with_it = analyse([recording], replace(rigid, effects=effects))
    ours, model = with_it.measured.resonance.frequency_Hz, with_it.model.resonance.frequency_Hz
    assert not ours.differs(model) and not with_it.differs
    assert "within the scatter" in with_it.answer[0]


def em_settings(name: str) -> dict[str, float]:
    from ema_model.effects import find

    return find(name).settings({})


def test_a_model_of_the_same_answers_the_same():
    found = analyse([swept()], em.load_actuator())
    assert found.answer[0] == "The model answers as was measured, within the scatter"
    assert not found.differs and found.measured.resonance is None
    assert found.measured.delay_s.value == pytest.approx(found.model.delay_s.value, abs=5e-5)


def noise_only() -> Measurement:
    """Current and motion that have nothing to do with each other."""
    random = np.random.default_rng(1)
    time = np.arange(0.0, 8.0, 1e-3)
    position = np.cumsum(np.cumsum(random.standard_normal(time.size))) * 1e-6
    return Measurement({"time_s": time, "current_A": random.standard_normal(time.size), "motor_position_rad": position})


REFUSED = {
    "a step": (lambda: em.simulate("step", duration_s=3.0, noise_A=0.1), "moves once or twice only, as steps do"),
    "short": (lambda: em.simulate("chirp", duration_s=0.2), "too short"),
    "noise": (noise_only, "the excitation does not suffice"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_excites_nothing_is_told_nothing_of(name, tmp_path):
    made, words = REFUSED[name]
    found = analyse([made()], em.load_actuator() if name != "noise" else drive_of(tmp_path, False))
    assert words in found.reason and found.reason in found.answer[0]
    assert found.measured is None and found.model is None and not found.differs and found.frequency_Hz.size == 0
    assert found.figures() == []


def test_an_input_or_output_that_is_not_there_is_one_line(tmp_path):
    drive, recording = drive_of(tmp_path, False), flexible_drive(3, 22.0, seconds=2.0)
    for options, words in (
        ({"input": "voltage"}, "motor_voltage_V is needed"),
        ({"output": "user"}, "user_position_rad is needed"),
        ({"output": "current"}, "is the input"),
        ({"input": "torque"}, "input must be one of auto, command, current, voltage, not 'torque'"),
        ({"inputs": "current"}, "no option 'inputs'; there are input, output"),
    ):
        with pytest.raises(InputError, match=words):
            em.analyse("frequency", recording, drive, **options)
    with pytest.raises(InputError, match="no analysis 'frequenzy'; there are frequency; did you mean"):
        em.analyse("frequenzy", recording, drive)
    coarse = Measurement({name: values[::4] for name, values in recording.signals.items()}, name="coarse")
    with pytest.raises(InputError, match="several rates"):
        analyse([recording, coarse], drive)


def test_its_json_form_is_its_schemas_and_leads_back(flexible):
    document = json.loads(json.dumps(flexible.to_dict(), allow_nan=False))
    assert msgspec.convert(document, json_type(FrequencyResponse), strict=True) == document
    again = FrequencyResponse.from_dict(document)
    assert str(again) == str(flexible) and again.to_dict() == document
    assert np.array_equal(again.measured.magnitude_dB, flexible.measured.magnitude_dB, equal_nan=True)
    assert {"measured", "model", "differs", "answer"} <= described(FrequencyResponse).keys()
    for wrong in ({**document, "counts": 3}, {"input": "command_rad"}, {**document, "measured": {"sigma": "x"}}):
        with pytest.raises(InputError, match="compute it anew"):
            FrequencyResponse.from_dict(wrong)


def test_it_shows_and_exports_itself(flexible, tmp_path):
    assert [figure.layout.yaxis.title.text for figure in flexible.figures()] == [
        "Magnitude [dB of rad per A]", "Phase [°]", "Coherence γ² [-]"
    ]  # fmt: skip
    for suffix in (".json", ".csv", ".html", ".rrd"):
        flexible.export(tmp_path / f"found{suffix}")
    head, *rows = (tmp_path / "found.csv").read_text().splitlines()
    assert head.startswith("frequency_Hz,counts,measured_magnitude_dB") and len(rows) == flexible.frequency_Hz.size
    assert json.loads((tmp_path / "found.json").read_text()) == json.loads(json.dumps(flexible.to_dict()))
    assert "<svg" not in flexible._repr_html_() and "resonance [Hz]" in flexible._repr_html_()
    with pytest.raises(InputError, match=r"found\.xls: a result is written as \.json, \.html, \.rrd, \.csv"):
        flexible.export(tmp_path / "found.xls")
    with pytest.raises(InputError, match="does not exist"):
        flexible.export(tmp_path / "nowhere" / "found.csv")


def test_what_it_states_is_read_without_importing_it():
    (one,) = [one for one in analyses().values() if one.name == "frequency"]
    assert one.title == "Frequency response" and list(one.options) == ["input", "output"]
    assert one.result is FrequencyResponse
