"""One colour for each thing, in the charts, the bars and the recordings; legible on light and dark."""

REFERENCE = "#2f6fde"
MONITOR = "#f08c00"
DIFFERENCE = "#e03131"
COMMAND = "#868e96"
FAULT = "#ff5a00"  # on the actuator: what is broken, and nothing else
FITTED, HELD_OUT = "#1098ad", "#9c36b5"  # what was fitted, and what was not
LIMIT = "#c2255c"  # what calls for attention: a threshold, a unit that differs
TRUTH = "#2b8a3e"
GHOST = "#9c6ade"  # a frozen run
RUNS = ("#74920b", "#8463f0")  # two runs beside each other
PHASES = ("#c9a200", "#0fa58a", "#c2459e")  # A, B, C, in the charts and in the windings: none is a model's or a fault's
ALGORITHMS = {"robust": MONITOR, "ssa": "#9c36b5", "hba": "#846358", "do": "#1098ad"}


def rgb(colour: str) -> tuple[int, int, int]:
    """Of "#rrggbb", 0 … 255 each."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue
