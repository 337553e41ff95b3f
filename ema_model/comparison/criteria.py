"""The numbers that decide what a comparison says, each with its source."""

from __future__ import annotations

# Of the residual's means over 25 ms to their floor, from which on the model has failed.  Healthy three-phase plants
# stay below 1.6 (tests/comparison/test_study.py, 100 of them).
SLOW = 2.0

# Times the floor, of the error pooled over signals: up to here what is left may be noise and the model's own floor.
# Healthy three-phase plants leave 0.6 … 1.1, foreign rigs with anything missing 1.6 or more
# (tests/discovery/test_discovery_study.py and test_foreign_rig_study.py).
BAND = 1.25
