"""The worst regions: ranges of a variable in which the residual stands out of its floor most, one way."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.explain import Explanation, quantile_knots, used_blocks
from ema_model.comparison.residuals import Residuals
from ema_model.comparison.result import Region
from ema_model.comparison.sentences import range_text, region_sentence
from ema_model.quantities.axes import Axes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_BINS = 20
_SPREAD = 0.5  # of the peak's mean, down to which neighbouring bins belong to its region
_ALIKE = 0.6  # of the smaller region's blocks, from which on two regions are one
_LEAST_Z = 4.0  # of a region's mean over its error
_SLOW = 0.08  # of the largest speed, below which a region is that of reversals
_ALWAYS = ("load", "motor_speed", "user_position", "time")
_ONE_WAY = 0.9
_DIGITS = (3, 4, 5, 6)  # of the ends of a range, as many as tell it from another one


def worst_moment(residuals: Residuals, region: Region) -> tuple[int, int]:
    """The recording and the block, of all joined ones, in the region whose residual is most out of its floor."""
    size = np.abs(residuals.values[region.signal]) / residuals.sigma[region.signal]
    at = int(np.argmax(np.where(region.blocks & np.isfinite(size), size, -1.0)))
    return int(residuals.recording[at]), at


def worst_regions(
    residuals: Residuals,
    signal: str,
    explanations: Sequence[Explanation],
    axes: Axes,
    recordings: Sequence[str] = (),
    count: int = 5,
) -> list[Region]:
    """Up to `count` regions, distinct from one another in place and in words; those of the best explanation first.

    recordings: their names.
    """
    used = used_blocks(residuals, signal)
    if used is None:
        return []
    told = [(one.variable, one.modulator) for one in explanations if one.significant][:2]
    others = [(name, "1") for name in _ALWAYS if name in residuals.variables]
    found: list[Region] = []
    for group in ([told[0]] if told else [], [*told[1:], *others]):
        regions = [
            region
            for variable, modulator in dict.fromkeys(group)
            for way in ((1, -1) if modulator == "sign_speed" else (None,))
            for region in _of_variable(residuals, signal, variable, way, used.chosen, axes)
        ]
        for region in sorted(regions, key=lambda one: -abs(one.mean) * np.sqrt(np.count_nonzero(one.blocks))):
            if len(found) < count and not any(_alike(region, other) for other in found):
                found.append(region)
    return _named_apart(found, residuals, signal, axes, recordings)


def _named_apart(
    regions: Sequence[Region], residuals: Residuals, signal: str, axes: Axes, recordings: Sequence[str]
) -> list[Region]:
    """Regions of one and the same sentence say their range and, where they lie in one of several, the recording."""
    named = list(regions)
    for digits in _DIGITS:
        counts = Counter(region.sentence for region in named)
        if len(counts) == len(named):
            break
        for i, region in enumerate(regions):
            if counts[named[i].sentence] > 1:
                details = range_text(region.variable, region.low, region.high, axes, digits)
                inside = np.unique(residuals.recording[region.blocks])
                if len(recordings) > 1 and len(inside) == 1:
                    details += f", in {recordings[int(inside[0])] or f'recording {inside[0] + 1}'}"
                place = region.variable, region.low, region.high, region.blocks
                named[i] = _region(residuals, signal, *place, axes, details)
    return named


def _of_variable(
    residuals: Residuals, signal: str, variable: str, way: int | None, chosen: Mask, axes: Axes
) -> Iterator[Region]:
    """The worst region with a positive mean, and the worst with a negative one."""
    values = residuals.variables[variable]
    usable = chosen & np.isfinite(values)
    if way is not None:
        usable &= residuals.direction == way
    if np.count_nonzero(usable) < 4 * _BINS or np.ptp(values[usable]) == 0.0:
        return
    if variable == "motor_angle" and axes.motor == "rotary":
        values = np.mod(values, 2.0 * np.pi)
        edges = np.linspace(0.0, 2.0 * np.pi, 2 * _BINS + 1)
    else:
        edges = quantile_knots(values[usable], _BINS + 1)
    error = residuals.values[signal]
    masks = [usable & (values >= low) & (values <= high) for low, high in pairwise(edges)]
    means = np.array([float(np.mean(error[mask])) if mask.any() else 0.0 for mask in masks])
    for sign in (1.0, -1.0):
        peak = int(np.argmax(sign * means))
        if sign * means[peak] <= 0.0:
            continue
        first = last = peak
        while first > 0 and sign * means[first - 1] > _SPREAD * sign * means[peak]:
            first -= 1
        while last < len(means) - 1 and sign * means[last + 1] > _SPREAD * sign * means[peak]:
            last += 1
        mask = np.logical_or.reduce(masks[first : last + 1])
        region = _region(residuals, signal, variable, float(edges[first]), float(edges[last + 1]), mask, axes)
        sigma = residuals.sigma[signal][mask]
        if abs(region.mean) > _LEAST_Z * float(np.sqrt(np.mean(sigma**2) / mask.sum())):
            yield region


def _region(
    residuals: Residuals, signal: str, variable: str, low: float, high: float, mask: Mask, axes: Axes, details: str = ""
) -> Region:
    error = residuals.values[signal][mask]
    rmse, mean = float(np.sqrt(np.mean(error**2))), float(np.mean(error))
    direction = residuals.direction[mask]
    forward, back = np.mean(direction > 0.0), np.mean(direction < 0.0)
    way = 1 if forward > _ONE_WAY else -1 if back > _ONE_WAY else 0
    speed = residuals.variables.get("motor_speed")
    slow = False
    if variable == "motor_speed" and speed is not None:
        slow = float(np.mean(np.abs(speed[mask]))) < _SLOW * float(np.nanmax(np.abs(speed)))
    time = residuals.variables.get("time")
    return Region(
        signal=axes.signal(signal),
        variable=variable,
        low=low,
        high=high,
        rmse=rmse,
        mean=mean,
        excess=rmse / float(np.sqrt(np.mean(residuals.sigma[signal][mask] ** 2))),
        sentence=region_sentence(
            axes.signal(signal),
            variable,
            low,
            high,
            float(np.mean(residuals.variables[variable][mask])),
            mean,
            way,
            torque_constant=residuals.torque_constant,
            axes=axes,
            duration_s=0.0 if time is None else float(np.nanmax(time)),
            slow=slow,
            details=details,
        ),
        blocks=mask,
    )


def _alike(one: Region, other: Region) -> bool:
    common = np.count_nonzero(one.blocks & other.blocks)
    return bool(common > _ALIKE * min(np.count_nonzero(one.blocks), np.count_nonzero(other.blocks)))
