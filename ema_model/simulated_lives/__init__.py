"""Lives of units, made for tests and for teaching: wear from flight to flight until a fault crosses its threshold.

A life is drawn from a seed.  Its flights are recordings of the three-phase model (`recorded`), or k̂ drawn directly
from what identifications of such recordings were found to be able to tell (`drawn`), thousands of lives in minutes.
"""

from ema_model.simulated_lives.life import LAWS, Life, drawn, healthy_life, recorded, worn_life

__all__ = ["LAWS", "Life", "drawn", "healthy_life", "recorded", "worn_life"]
