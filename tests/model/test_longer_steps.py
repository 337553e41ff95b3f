"""A window at longer steps: the same inputs, thinned, and the same kernel."""

from __future__ import annotations

import numpy as np

from ema_model.actuator import load_actuator
from ema_model.models.loop_window import cut
from ema_model.simulation.run import Run, simulate_reference


def test_its_inputs_are_those_of_the_own_steps_thinned_and_in_one_piece():
    """A kernel is compiled anew, for seconds, for an array that is not in one piece."""
    actuator = load_actuator()
    (own,) = cut(simulate_reference(Run(), actuator), actuator)
    longer = own.at_longer_steps(2e-5)
    times = round(longer.step_s / own.step_s)
    assert times == 2 and longer.steps_per_sample * times == own.steps_per_sample
    for name in ("command", "load", "supply"):
        thinned = getattr(longer, name)
        np.testing.assert_array_equal(thinned, getattr(own, name)[::times])
        assert thinned.flags.c_contiguous
