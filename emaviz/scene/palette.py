"""Colours of the actuator: greys, phases in subdued tones, one colour for what is broken, another for an error."""

from __future__ import annotations

from emaviz import colours

Colour = tuple[int, int, int]


def between(one: Colour, other: Colour, share: float) -> Colour:
    """From one colour at share 0 to the other at 1."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(one, other))
    return red, green, blue


GLASS: Colour = (150, 160, 176)  # the housing
LIGHT: Colour = (212, 216, 222)
STEEL: Colour = (172, 177, 186)
SATIN: Colour = (140, 146, 156)
IRON: Colour = (104, 109, 119)
DARK: Colour = (76, 81, 91)
WHITE: Colour = (255, 255, 255)
FAULT = colours.rgb(colours.FAULT)
RESIDUAL = colours.rgb(colours.DIFFERENCE)
PHASES = tuple(colours.rgb(one) for one in colours.PHASES)
AT_REST = tuple(between(between(one, IRON, 0.5), DARK, 0.35) for one in PHASES)  # a phase without current
