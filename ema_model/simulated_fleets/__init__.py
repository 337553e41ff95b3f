"""Fleets of one type of actuator, made for tests and for teaching: units that differ in what is drawn, and is known.

A fleet is drawn from a seed; its recordings are the three-phase model's, with sensors' noise.
"""

from ema_model.simulated_fleets.fleet import RUNS, UNSEEN, Difference, Fleet, draw, recorded

__all__ = ["RUNS", "UNSEEN", "Difference", "Fleet", "draw", "recorded"]
