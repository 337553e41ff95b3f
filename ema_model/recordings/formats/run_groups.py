"""Files with a group for each run, all with the same channels: HDF5's groups, TDMS's, MATLAB's structs in a row.

They become one table with a column that numbers the runs, as texts have it.  Groups alike may as well be the axes of
one machine, so that their names must say that they are runs: trial_3, test(2), 2024-05-01.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ema_model.recordings.column_names import QUANTITIES
from ema_model.recordings.formats.channels import Array, Channel, Log
from ema_model.recordings.formats.own_clocks import is_clock

RUN = "run"
_RUNS = QUANTITIES["segment"] | frozenset(
    "runs trials test tests experiment exp shot measurement meas messung versuch cycle sweep recording rec record log "
    "data flight series".split()
)
_MOST_TOLD = 12


def with_runs(log: Log) -> Log:
    """The log with its groups one after the other, where each is a run with a time of its own; else as it is."""
    groups: dict[tuple[str, ...], dict[str, Channel]] = {}
    for one in log.channels:
        groups.setdefault(one.path[:-1], {})[one.path[-1]] = one
    if log.clocks or not _are_runs(log, groups):
        return log
    ordered = sorted(groups, key=lambda group: [_natural(part) for part in group])
    numbers = _numbers([group[-1] for group in ordered])
    runs = [groups[group] for group in ordered]
    lengths = [next(iter(run.values())).samples for run in runs]
    samples = sum(lengths)
    channels = [
        replace(one, path=(name,), samples=samples, values=partial(_joined, [run[name] for run in runs]))
        for name, one in runs[0].items()
    ]
    channels.append(Channel((RUN,), samples, partial(np.repeat, np.array(numbers, float), lengths), holds=True))
    told = [f"{number} is {group[-1]}" for number, group in zip(numbers, ordered)]
    more = ", …" if len(told) > _MOST_TOLD else ""
    return replace(log, channels=channels, notes=(*log.notes, f"a run a group: {', '.join(told[:_MOST_TOLD])}{more}"))


def _are_runs(log: Log, groups: dict[tuple[str, ...], dict[str, Channel]]) -> bool:
    """Whether all channels stand in groups side by side, with the same names and one time each."""
    first = next(iter(groups.values()), {})
    if len(groups) < 2 or len(first) < 2 or RUN in first or () in groups or len({group[:-1] for group in groups}) > 1:
        return False
    if not all(_is_run(group[-1]) for group in groups):
        return False
    if sum(map(len, groups.values())) < len(log.channels):  # a name stands twice in a group
        return False
    return all(
        run.keys() == first.keys()
        and len({one.samples for one in run.values()}) == 1
        and all(one.unit == first[name].unit for name, one in run.items())
        and sum(map(is_clock, run.values())) == 1
        for run in groups.values()
    )


def _is_run(name: str) -> bool:
    words = set(re.findall(r"[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()))
    return not _RUNS.isdisjoint(words) or (not words and bool(re.search(r"\d", name)))


def _numbers(names: Sequence[str]) -> list[int]:
    """The numbers that the groups' names end in, where all do and no two the same; else 1, 2, 3 …"""
    ends = [re.search(r"(\d{1,9})\)?$", name) for name in names]
    found = [int(end[1]) for end in ends if end]
    return found if len(set(found)) == len(names) else list(range(1, len(names) + 1))


def _natural(text: str) -> list[tuple[int, str]]:
    """A key by which trial2 stands before trial10."""
    return [(int(part[:18]), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", text)]


def _joined(parts: Sequence[Channel]) -> Array:
    return np.concatenate([np.asarray(part.values()).reshape(-1) for part in parts])
