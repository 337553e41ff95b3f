"""A discovery that goes on from a finished comparison begins where that ended, and comes to as much."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ema_model.actuator import load_actuator
from ema_model.challenges import challenges, opened
from ema_model.comparison import compare
from ema_model.discovery.history import begun
from ema_model.recordings import read


@pytest.mark.long
def test_it_begins_where_the_comparison_ended():
    first = challenges()[0]
    with opened(first) as known:
        actuator = load_actuator(known.actuator)
        fitted, held = ([read(file, actuator) for file in files] for files in (known.training, known.holdout))
    compared = compare(fitted, actuator, holdout=held)
    said: dict[bool, list[str]] = {True: [], False: []}
    alone = begun(fitted, actuator, held, tell=said[False].append)
    after = begun(fitted, actuator, held, tell=said[True].append, compared=compared)
    simulated = {which: sum("simulations" in one for one in lines) for which, lines in said.items()}
    assert simulated[True] < 0.6 * simulated[False], "no second search from the file's values"
    assert after.current.calibration.converged and after.current.calibration.is_final
    # a loop of relays is fitted to a few per cent of its error, wherever one begins
    assert after.ladder[0].rmse == pytest.approx(alone.ladder[0].rmse, rel=0.1)
    assert after.ladder[0].holdout_rmse == pytest.approx(alone.ladder[0].holdout_rmse, rel=0.15)
    assert compared.calibration is not None
    doubtful = replace(compared, calibration=replace(compared.calibration, converged=False))
    again: list[str] = []
    begun(fitted, actuator, held, tell=again.append, compared=doubtful)
    assert "calibrating" in again, "what has not converged is not gone on from"
