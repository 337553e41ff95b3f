"""How each plotted entity is drawn: a static line or point style beside its values."""

from __future__ import annotations

import rerun as rr

from ema_model.identification.run import algorithm_title
from emaviz.recording import style
from emaviz.recording.style import Colour

Style = rr.SeriesLines | rr.SeriesPoints


def signal_style(group: str, name: str) -> Style:
    """A signal's line: colour of its group, name with unit."""
    return line(style.series_title(group, name), style.signal_colour(group, name), style.GROUP_WIDTHS[group])


def monitor_style(index: int) -> Style:
    """The monitor's current on an iteration: the later, the more the monitor's own colour."""
    return line(f"MM iteration {index} [A]", style.iteration_colour(index), 1.2)


def iteration_style(path: str) -> Style:
    """The style of an entity over iterations, by its place under /identification/<algorithm>/."""
    _, _, algorithm, kind, *rest = path.split("/")
    colour, title = style.algorithm_colour(algorithm), algorithm_title(algorithm)
    name = rest[0] if rest else ""
    if kind == "population":
        return rr.SeriesPoints(
            names=f"population {name}", colors=[style.POPULATION_COLOUR], markers="circle", marker_sizes=[1.3]
        )
    if kind == "interval":
        return rr.SeriesPoints(names=f"90 % interval {name}", colors=[colour], markers="diamond", marker_sizes=[5.0])
    if kind == "best":
        return line(f"{title} best {name} [-]", colour, 2.5)
    if kind == "truth":
        return line(f"true {name} [-]", style.TRUTH_COLOUR, 2.0)
    # Series of one name share an entry of the legend; the logarithm's plot says in its title what they are.
    which = "corrected" if kind == "corrected_error" else "uncorrected"
    if kind == "log10_rmse":
        title = f"{title}, uncorrected"
    return line(title if kind.startswith("log10") else f"{title}, {which} error of the best [A]", colour, 2.0)


def line(name: str, colour: Colour, width: float) -> Style:
    # The default aggregation averages, which hides the chopping ripple's peaks.
    return rr.SeriesLines(names=name, colors=[colour], widths=[width], aggregation_policy="MinMax")
