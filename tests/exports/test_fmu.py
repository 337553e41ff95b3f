"""The exported FMU is valid, of both versions; it runs elsewhere as here, and holds its own source."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.exports import c, fmu
from ema_model.exports.exported import exported
from ema_model.exports.replay import EXACT, proof_of, replayed

ACTUATORS = Path(__file__).parents[2] / "assets" / "actuators"

fmpy = pytest.importorskip("fmpy")


def silent(text: str) -> None:
    """Of a proof's progress."""


def made(name: str, folder: Path, version: str = "3.0"):
    """What is exported, and its FMU."""
    one = exported(load_actuator(ACTUATORS / f"{name}.toml"))
    path = folder / f"{one.name}.fmu"
    fmu.write_fmu(one, path, version)
    return one, path


@pytest.mark.parametrize("version", fmu.VERSIONS)
@pytest.mark.parametrize("name", ["thesis", "odrive"])
def test_an_fmu_is_valid_and_the_model(name, version, tmp_path):
    one, path = made(name, tmp_path, version)
    assert fmu.problems_of(path) == []
    losses = replayed(proof_of(one, [], silent), fmu.RunningFmu(one, path, tmp_path / "unpacked"), silent)
    assert max(loss.difference for each in losses for loss in each.signals.values()) <= EXACT


def test_fmpy_simulates_it_by_itself(tmp_path):
    """By its own master, with a communication step of ten of the model's: a step of the command is followed."""
    _, path = made("thesis", tmp_path)
    inputs = np.array([(0.0, 1e-3), (0.1, 1e-3)], dtype=[("time", float), ("command_rad", float)])
    shown = fmpy.simulate_fmu(
        str(path), stop_time=0.1, step_size=1e-4, output_interval=1e-4, input=inputs,
        output=["user_position_rad", "current_A"], start_values={"dynamic_friction": 0.03},
    )  # fmt: skip
    assert shown["user_position_rad"][-1] == pytest.approx(1e-3, abs=2e-5)
    assert np.max(np.abs(shown["current_A"])) > 1.0


@pytest.mark.parametrize("version", fmu.VERSIONS)
def test_its_source_compiles_alone(version, tmp_path):
    one, path = made("xl330", tmp_path, version)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "unpacked")
    sources = sorted((tmp_path / "unpacked" / "sources").glob("*.c"))
    assert {file.name for file in sources} == {f"{one.name}.c", f"fmi{version[0]}.c", "refusals.c"}
    c.compile_library(sources, tmp_path / "again.so")


def test_the_same_model_has_the_same_token_and_another_has_another(tmp_path):
    one, path = made("xl330", tmp_path)
    changed = exported(load_actuator(ACTUATORS / "xl330.toml").varied({"motor.inertia_kgm2": 7e-3}))
    with zipfile.ZipFile(path) as archive:
        assert fmu.token(one) in archive.read("modelDescription.xml").decode()
    assert fmu.token(exported(load_actuator(ACTUATORS / "xl330.toml"))) == fmu.token(one) != fmu.token(changed)


@pytest.mark.parametrize("version", fmu.VERSIONS)
def test_a_state_is_kept_and_set_again(version, tmp_path):
    one, path = made("thesis", tmp_path, version)
    instance = fmu.RunningFmu(one, path, tmp_path / "unpacked").instance()
    if version == "2.0":
        instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    third = version == "3.0"
    read, write = (instance.getFloat64, instance.setFloat64) if third else (instance.getReal, instance.setReal)
    write([1], [1e-3])

    def steps(count: int, start: int) -> list[float]:
        for i in range(start, start + count):
            instance.doStep(currentCommunicationPoint=i * 1e-5, communicationStepSize=1e-5)
        return list(read([4, 5, 6, 7]))

    before = steps(500, 0)
    kept = instance.getFMUState() if third else instance.getFMUstate()
    later = steps(200, 500)
    assert later != before
    back = instance.setFMUState if third else instance.setFMUstate
    back(kept)
    assert steps(200, 500) == later
    with pytest.raises(Exception, match=r"(?i)error"):
        write([12], [1.0])  # a parameter, which is fixed by now
    instance.freeInstance()


def test_units_are_si():
    assert fmu.base_units("N·m·s²/rad") == {"kg": 1, "m": 2, "rad": -1}
    assert fmu.base_units("1/(kg·m²)") == {"kg": -1, "m": -2}
    assert fmu.base_units("A/(N·m)") == {"A": 1, "kg": -1, "m": -2, "s": 2}
    assert fmu.base_units("turns") is None
