"""Controls with nothing hidden, as loggers take them: none may raise an alarm by how it was logged.

pytest -m study -s tests/comparison/test_loggers.py
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from support.loggers import COMMANDS, Logger, healthy

from ema_model.commands.command import between
from ema_model.comparison import compare

LOGGERS = [
    Logger(500.0),
    Logger(1000.0),
    Logger(2000.0),
    Logger(5000.0),
    Logger(10_000.0),
    Logger(2000.0, jitter=0.6),
    Logger(10_000.0, jitter=0.6),
    Logger(5000.0, jitter=0.3, lost=0.05),
    Logger(10_000.0, filter_s=1e-3),
    Logger(2000.0, lost=0.05),
]


@pytest.mark.study
def test_however_it_was_logged_nothing_is_missing():
    """Forty: ten loggers, four commands."""
    alarms = []
    for seed, (name, logger) in enumerate(itertools.product(COMMANDS, LOGGERS)):
        found = compare([logger.log(healthy(name), seed)])
        told = f"{name}, {logger}: {found.verdict}, {found.over_floor:.3f} floors; {found.sentences[0]}"
        print(told)
        if not found.adequate:
            alarms.append(told)
    print(f"adequate: {40 - len(alarms)} of 40")
    assert len(alarms) <= 2, alarms


def test_two_straight_lines_meet_between_samples():
    """A chord would cut the corner off by a quarter of what the slope makes in a sample."""
    time = np.arange(0.0, 0.1, 2e-3)
    fine = np.arange(0.0, 0.09, 1e-5)
    for corner in (0.0313, 0.0308, 0.0301):
        line = between(fine, time, 0.03 - np.abs(time - corner))
        assert np.abs(line - (0.03 - np.abs(fine - corner))).max() < 1e-12
    smooth = between(fine, time, 0.03 * np.sin(20.0 * time))
    assert np.abs(smooth - 0.03 * np.sin(20.0 * fine)).max() < 2e-7
