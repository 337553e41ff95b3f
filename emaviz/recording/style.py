"""Where things lie in a recording and how they look: entity paths, series names with units, colours."""

from __future__ import annotations

import re

import numpy as np

from ema_model.faults import FAULTS
from ema_model.quantities import SIGNALS
from emaviz import colours

Colour = tuple[int, int, int, int]


def _rgba(hexadecimal: str, alpha: int = 255) -> Colour:
    return *colours.rgb(hexadecimal), alpha


APPLICATION = "emaviz"
PROPERTIES = "emaviz"
SIM_TIME = "sim_time"
ITERATION = "iteration"
K_NAMES = tuple(fault.name for fault in FAULTS)
K_TITLES = {fault.name: f"{fault.name} {fault.title[0].lower()}{fault.title[1:]} [-]" for fault in FAULTS}
# Beside a view's title stand buttons: four views in a line leave it two dozen letters where the app holds the viewer.
DASHBOARD_TITLES = {name: title.removesuffix(" [-]") for name, title in K_TITLES.items()}

COMPARISON = "/comparison"
ANSWER = "/answer"
GROUPS = ("reference", "monitor", "measurement", "initial", "residual", "floor_high", "floor_low")
GROUP_TITLES = {"reference": "RM", "monitor": "MM", "measurement": "Measured", "residual": "Residual"}
# Of a comparison: the model before calibration, and the edges between which a perfect one would leave its residual.
GROUP_TITLES |= {
    "initial": "MM before calibration",
    "floor_high": "Floor, upper edge",
    "floor_low": "Floor, lower edge",
}
GROUP_COLOURS: dict[str, Colour] = {
    "reference": _rgba(colours.REFERENCE, 200),
    "monitor": _rgba(colours.MONITOR),
    "measurement": _rgba(colours.REFERENCE, 150),
    "residual": _rgba(colours.DIFFERENCE),
    "initial": _rgba(colours.COMMAND, 160),
    "floor_high": _rgba(colours.COMMAND),
    "floor_low": _rgba(colours.COMMAND),
}
# Lines are drawn in the order of their paths, so what lies below is wider, and the reference lets it shine through.
GROUP_WIDTHS = {"reference": 1.3, "monitor": 3.0, "measurement": 4.0, "residual": 1.3}
GROUP_WIDTHS |= {"initial": 1.3, "floor_high": 1.5, "floor_low": 1.5}
TRUTH_COLOUR = _rgba(colours.TRUTH)
POPULATION_COLOUR = _rgba(colours.COMMAND, 80)
_PLAIN = re.compile(r"[A-Za-z0-9_]+")


def plain(name: str) -> str:
    """The name itself, if it can be one part of an entity path without escapes; ValueError otherwise."""
    if not _PLAIN.fullmatch(name):
        raise ValueError(f"{name!r} cannot name a part of a recording: letters, digits and _ only")
    return name


def signal_title(name: str) -> str:
    """'Equivalent current [A]' of 'current_A'; the name itself when it is not a canonical one."""
    signal = SIGNALS.get(name)
    if signal is None:
        return name
    return f"{signal.title} [{signal.unit or '-'}]"


def series_title(group: str, name: str) -> str:
    """'RM equivalent current [A]': what the legend says."""
    title = signal_title(name)
    return f"{GROUP_TITLES[group]} {title[0].lower()}{title[1:]}"


def signal_colour(group: str, name: str) -> Colour:
    """The group's colour; phases B and C are lighter and darker, as the three share a plot."""
    red, green, blue, alpha = GROUP_COLOURS[group]
    if name.startswith("phase_b"):
        return (red + 255) // 2, (green + 255) // 2, (blue + 255) // 2, alpha
    if name.startswith("phase_c"):
        return red * 5 // 9, green * 5 // 9, blue * 5 // 9, alpha
    return red, green, blue, alpha


def iteration_colour(index: int) -> Colour:
    """From grey to the monitor's colour as the iterations go by (150 is usual)."""
    share = min(index / 150.0, 1.0) ** 0.5
    start, end = np.array(POPULATION_COLOUR), np.array(GROUP_COLOURS["monitor"])
    red, green, blue, alpha = (start + share * (end - start)).astype(int).tolist()
    return red, green, blue, alpha


def algorithm_colour(algorithm: str) -> Colour:
    """The algorithm's own colour; the monitor's for one without."""
    return _rgba(colours.ALGORITHMS.get(algorithm, colours.MONITOR))


def algorithm_path(algorithm: str) -> str:
    """'/identification/hba'."""
    return f"/identification/{plain(algorithm)}"


def monitor_iteration_path(algorithm: str, index: int) -> str:
    """'/identification/hba/monitor/iteration_0040/current_A'."""
    return f"{algorithm_path(algorithm)}/monitor/iteration_{index:04d}/current_A"
