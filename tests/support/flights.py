"""Flights as an identification would tell them, of which k1 goes a given way."""

from __future__ import annotations

import numpy as np

from ema_model import faults
from ema_model.estimation.problem import to_vector
from ema_model.tracking.flights import Flight


def flights(k1, sigma=0.01, base=2, seed=0, common=None):
    """A unit of which k1 goes this way."""
    random = np.random.default_rng(seed)
    u = random.standard_normal(base)
    found = []
    for i, value in enumerate(k1):
        k = to_vector(faults.HEALTHY) + sigma * random.standard_normal(8)
        row = np.zeros((8, base)) if common is None else common(i)
        k[0] += value
        found.append(Flight(f"f{i:03d}", k + row @ u, sigma**2 * np.eye(8), row))
    return found
