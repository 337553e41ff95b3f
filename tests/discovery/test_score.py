"""What counts as a strong case of an effect on a machine of another size."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.discovery.candidates import score
from ema_model.effects import find


@pytest.mark.parametrize(
    ("name", "current_A", "strong"),
    [
        ("torque_saturation", 22.5, 1.0 / 67.5),
        ("torque_saturation", 3.0, 1.0 / 9.0),
        ("torque_saturation", 300.0, 0.0125),
        ("torque_saturation", 0.0, 0.0125),
        ("mesh_friction", 3.0, 0.25),
    ],
    ids=["the library's motor", "a small one", "a large one", "no current known", "a ratio"],
)
def test_iron_saturates_by_what_its_machine_draws(name, current_A, strong):
    signals = {"current_A": np.array([0.5, -1.0]) * current_A}
    found = SimpleNamespace(calibration=SimpleNamespace(signals=[signals]))
    assert score._strong(found, find(name)) == pytest.approx(strong)
