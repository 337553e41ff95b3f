"""Challenges whose recordings are made when they are first opened: several units, a unit's life.

`kinds` holds a file for each kind.  Whoever wants to solve a challenge calls `make` only; `reveal` tells the answer.
"""

from ema_model.practice.make_and_reveal import challenge_in, make, reveal, shipped

__all__ = ["challenge_in", "make", "reveal", "shipped"]
