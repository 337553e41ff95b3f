"""Challenges: recordings of an actuator in which an effect may be hidden, for practice and for tests.

`python -m ema_model.challenges` makes the recordings from the truths in assets/challenges/truth.  Whoever wants to
solve a challenge reads `challenge.py` only; `truth.py` tells the answers.
"""

from ema_model.challenges.challenge import Challenge, challenges, folder, opened, sealed_challenge

__all__ = ["Challenge", "challenges", "folder", "opened", "sealed_challenge"]
