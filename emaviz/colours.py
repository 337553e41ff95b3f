"""One colour for each thing, in the charts, the bars and the recordings; legible on light and dark.

What stands beside each other stays apart for the colour-blind as well (`tests/app/test_colours.py`).
"""

REFERENCE = "#2f6fde"
MONITOR = "#f08c00"
DIFFERENCE = "#e03131"
COMMAND = "#868e96"
FAULT = "#ff5a00"  # on the actuator: what is broken, and nothing else
FITTED, HELD_OUT = "#1098ad", "#9c36b5"  # what was fitted, and what was not
LIMIT = "#c2255c"  # what calls for attention: a threshold, a unit that differs
TRUTH = "#2b8a3e"
GHOST = "#85ad8a"  # a frozen run
SLATE, PINK, BRONZE, ROSE, BROWN = "#3f6a70", "#f075c7", "#7a631f", "#e0859c", "#816056"  # without a meaning
FORWARD, BACKWARD = BRONZE, PINK  # means of one direction each
RUNS = (BRONZE, ROSE)  # two runs beside each other
PHASES = ("#b3a300", "#7733ff", "#dd88cc")  # A, B, C, in the charts and in the windings: like nothing with a meaning
ALGORITHMS = {"robust": MONITOR, "ssa": ROSE, "hba": BROWN, "do": SLATE}
CASES = (SLATE, PINK, BRONZE, GHOST, BROWN, ROSE)  # of a campaign, in their order
# Five severities, ever darker: of the monitor model and of the reference model.
MONITOR_SHADES = ("#fcc487", "#f59f4a", "#ea7317", "#c94f0a", "#a13a06")
REFERENCE_SHADES = ("#b3cdfa", "#84adf4", "#4f86e8", "#2c62c4", "#2a4f9c")


def rgb(colour: str) -> tuple[int, int, int]:
    """Of "#rrggbb", 0 … 255 each."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue
