"""Makes a challenge's recordings: the three-phase model with what is hidden, off within its tolerances, with noise.

The same truth gives the same values: all that is drawn comes from its seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ema_model.actuator import Actuator, load_actuator
from ema_model.challenges.truth import Truth
from ema_model.commands import command
from ema_model.effects.user import user_torque
from ema_model.estimation import default_free
from ema_model.recordings import Measurement
from ema_model.simulation.run import Effects, Run, simulate_reference
from ema_model.simulation.sensors import Sensors

RUNS = {
    "chirp": Run(command("chirp"), 0.5),
    "step": Run(command("step", {"final_rad": 0.005}), 0.5),
    "sine": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 1.0),
    "unseen": Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5.0}), 0.5),
}
SENSORS = Sensors(current_noise_A=0.45, encoder_bits=12)
COLUMNS = ("time_s", "command_rad", "user_position_rad", "motor_position_rad", "current_A")
_CONVERTER_STEP_A = 2.0**-7  # a 12-bit converter over ±16 A
_COMMAND_STEP_RAD = 2.0**-30
_WORST = 2.0  # σ that a parameter is off, at most
_RANGE = (-100.0, 100.0)  # of a hidden torque's parameters


def make(truth: Truth, where: Path) -> None:
    """Writes the challenge's recordings to the folder of its name, which must be there."""
    for name, recording in recorded(truth, load_actuator()):
        write(recording, where / truth.name / f"{name}.parquet")


def recorded(
    truth: Truth, actuator: Actuator, sensors: Sensors = SENSORS, load_torque_Nm: float = 0.0
) -> Iterator[tuple[str, Measurement]]:
    """The names and recordings of `RUNS`, one after another, under a constant load at the user.

    Raises InputError for an actuator that has no three-phase model, FloatingPointError if that one diverges.
    """
    plant, effects = plant_of(truth, actuator), _hidden(truth)
    for number, (name, run) in enumerate(RUNS.items()):
        loaded = replace(run, load_torque_Nm=load_torque_Nm)
        recording = simulate_reference(loaded, plant, truth.k, effects)
        yield name, sensors.record(recording, 1000 * truth.seed + number)


def plant_of(truth: Truth, actuator: Actuator) -> Actuator:
    """The actuator with each free parameter somewhere within its tolerance."""
    random = np.random.default_rng(truth.seed)
    drawn = {}
    for path in default_free(actuator):
        if not path.startswith("sensors."):
            off = float(np.clip(random.standard_normal(), -_WORST, _WORST))
            drawn[path] = actuator.value(path) + off * actuator.tolerances[path].sigma
    return actuator.with_values(drawn)


def _hidden(truth: Truth) -> Effects:
    if not truth.torque:
        return truth.effects
    own = user_torque(truth.torque, dict.fromkeys(truth.torque_parameters, _RANGE))
    return {**truth.effects, own.name: truth.torque_parameters}


def write(recording: Measurement, path: Path) -> None:
    """Small: what a converter would give has few digits, and bytes of a kind stand together.

    The load is written where there is one: whoever solves the challenge knows of it.
    """
    digits = {"current_A": _CONVERTER_STEP_A, "command_rad": _COMMAND_STEP_RAD}
    columns = {}
    for name in (*COLUMNS, "load_torque_Nm") if "load_torque_Nm" in recording else COLUMNS:
        step = digits.get(name)
        values = recording[name] if step is None else step * np.round(recording[name] / step)
        columns[name] = pa.array(values)
    pq.write_table(
        pa.table(columns).replace_schema_metadata({"emaviz_schema": "1"}),
        path,
        compression="zstd",
        compression_level=19,
        # The stubs know a bool only; columns by name are documented.
        use_dictionary=["user_position_rad", "motor_position_rad", "current_A"],  # pyright: ignore[reportArgumentType]
        column_encoding=dict.fromkeys(("time_s", "command_rad"), "BYTE_STREAM_SPLIT"),
    )
