"""Which signals of a run have a chart, and in which units: with the prefix that reads well in the range drawn."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.shown import of_signal

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SignalChart:
    """What one chart shows, and in which units, which only `fitted` changes: the axis stands still while one drags."""

    signal: str
    title: str
    unit: str
    scale: float
    difference_unit: str
    difference_scale: float
    with_command: bool


_SCALES = {"": 1.0, "m": 1e3, "µ": 1e6}
_MOST, _LEAST = 1000.0, 0.5  # of what is drawn, beyond which another prefix reads better; apart, so that none flickers
_PREFIXES = {  # of the signal, and of a difference in it
    "current_A": ("", ""),
    "user_position_rad": ("m", "µ"),
    "motor_position_rad": ("", "m"),
    "motor_speed_rad_s": ("", ""),
}


def charts(axes: Axes = ROTARY) -> tuple[SignalChart, ...]:
    """A chart for each signal of a run, in the units of these axes."""
    return tuple(
        SignalChart(
            name,
            (signal := of_signal(name, axes)).title,
            f"{prefix}{signal.unit}",
            _SCALES[prefix],
            f"{finer}{signal.unit}",
            _SCALES[finer],
            with_command=name == "user_position_rad",
        )
        for name, (prefix, finer) in _PREFIXES.items()
    )


def fitted(chart: SignalChart, values: Array, difference: Array) -> SignalChart:
    """The chart in units whose numbers read well, of values and of a difference in SI units."""
    plain = chart.unit.removeprefix(_prefix(chart.scale))
    scale, finer = _scale(values, chart.scale), _scale(difference, chart.difference_scale)
    return replace(
        chart,
        unit=_prefix(scale) + plain,
        scale=scale,
        difference_unit=_prefix(finer) + plain,
        difference_scale=finer,
    )


def _scale(values: Array, now: float) -> float:
    """The present one as long as its numbers are neither too large nor too small."""
    most = float(np.max(np.abs(values), initial=0.0))
    if not 0.0 < most < np.inf or _LEAST <= now * most < _MOST:
        return now
    return next((scale for scale in _SCALES.values() if scale * most >= 1.0), max(_SCALES.values()))


def _prefix(scale: float) -> str:
    return next(prefix for prefix, factor in _SCALES.items() if factor == scale)
