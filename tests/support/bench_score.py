"""What is said of a bench, beside what is true of it."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import ema_model as em
from ema_model.comparison.result import Comparison
from ema_model.discovery import Discovery
from ema_model.estimation import Calibrated
from support.benches import Bench

MOST_FLOORS = 2.0  # of what was held out, up to which a bench counts as represented


def row_of(bench: Bench, folder: Path) -> dict[str, Any]:
    """The answer to a bench's files, read and judged as its owner would have it; `error` where there is none."""
    began = time.monotonic()
    row: dict[str, Any] = {"name": bench.name, "task": bench.task, "form": bench.form, "error": ""}
    try:
        path, logs = bench.written(folder)
        actuator = em.load_actuator(path)
        *fitted, held = [em.read(log, actuator, bench.mapping) for log in logs]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if bench.task == "compare":
                wanted = {name: {} for name in bench.fitted_effects}
                row |= _compared(bench, em.compare(fitted, actuator, holdout=[held], effects=wanted or None))
            else:
                row |= _discovered(bench, em.discover(fitted, actuator, holdout=[held]))
    except em.InputError as error:
        row["error"] = str(error)
    row["seconds"] = time.monotonic() - began
    row.setdefault("represented", False)
    row.setdefault("intervals", {})
    row.setdefault("named", not bench.named)
    return row


def _compared(bench: Bench, found: Comparison) -> dict[str, Any]:
    over = [
        error.rmse / error.noise_floor
        for one in found.holdout
        for error in one.errors.values()
        if error.noise_floor > 0.0 and not error.silent
    ]
    held = math.sqrt(float(np.mean(np.square(over)))) if over else math.inf
    assert found.calibration is not None
    return {
        "verdict": found.verdict,
        "fitted": found.over_floor,
        "held": held,
        "represented": held < MOST_FLOORS,
        "intervals": _intervals(bench, found.calibration.parameters),
        "said": [*found.sentences, *found.warnings],
    }


def _discovered(bench: Bench, found: Discovery) -> dict[str, Any]:
    added = [*found.effects, *found.freed]
    names = [one.name for one in added]
    same = {one.name: [*one.same_as] for one in added}
    groups = [{one.name, *one.same_as} for one in added]
    known: dict[str, Calibrated] = dict(found.calibration.parameters)
    known |= {f"{one.name}.{name}": value for one in added for name, value in one.parameters.items()}
    seen = bench.seen == "two_masses" and found.two_masses_seen is not None
    right = len(groups) == len(bench.named) and all(any(name in group for group in groups) for name in bench.named)
    last = found.ladder[-1]
    held = math.inf if last.holdout_rmse is None else last.holdout_rmse
    return {
        "verdict": found.verdict,
        "ladder": [(str(one.change.names), one.rmse, one.holdout_rmse) for one in found.ladder],
        "fitted": last.rmse,
        "held": held,
        "represented": held < MOST_FLOORS or seen,
        "named": right or seen,
        "names": names,
        "same": same,
        "intervals": _intervals(bench, known),
        "said": str(found).splitlines()[:12],
    }


def _intervals(bench: Bench, known: Mapping[str, Calibrated]) -> dict[str, tuple[float, float, float]]:
    """Low, high and true of each value that is known to the bench and told."""
    true = {path.removeprefix("effects."): one for path, one in {**bench.owner.truth, **bench.hidden}.items()}
    own = {path.removeprefix("effects."): one for path, one in known.items()}
    return {path: (*own[path].interval90, value) for path, value in true.items() if path in own}


def line(row: Mapping[str, Any]) -> str:
    """The answer in a line."""
    if row["error"]:
        return f"{row['name']:26} {row['form']:10} REFUSED {row['error']}"
    out = [path for path, (low, high, true) in row["intervals"].items() if not low <= true <= high]
    names = "+".join("≡".join([name, *row["same"][name]]) for name in row.get("names", ())) or "-"
    marks = f"{'ok ' if row['represented'] else 'OFF'} {'named' if row['named'] else 'WRONG'}"
    return (
        f"{row['name']:26} {row['form']:10} {marks:10} {row['verdict']:16} {names:34} fitted {row['fitted']:8.3g} held "
        f"{row['held']:8.3g}  {len(row['intervals']) - len(out)}/{len(row['intervals'])} "
        f"{' '.join(out)}  {row['seconds']:.0f} s"
    )
