"""By what a sensitivity to the base parameters grows with the k that it belongs to."""

from __future__ import annotations

import numpy as np

from ema_model.simulated_lives.life import WORN_AT, accuracy
from ema_model.tracking.series import growth


def test_it_grows_as_identifications_of_worn_actuators_have_it():
    """Backlash, of all profiles: identified with the fault, over identified without."""
    k = np.zeros((2, 8))
    k[1, 1] = WORN_AT
    healthy, worn = growth(k)[:, 1]
    found = np.linalg.norm(accuracy().common[[0, 2], :, 1], axis=2)
    assert worn > 20.0 * healthy
    np.testing.assert_allclose(found[1] / found[0], worn / healthy, rtol=0.1)


def test_noise_beyond_the_range_counts_as_its_end():
    np.testing.assert_array_equal(growth(np.full(8, -0.5)), growth(np.zeros(8)))
    np.testing.assert_array_equal(growth(np.full(8, 1.5)), growth(np.ones(8)))
