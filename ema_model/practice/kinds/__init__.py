"""The kinds of challenges that are made: each other file of this folder is one, under its file's name."""

from ema_model.members import members
from ema_model.practice.kinds.kind import Kind

KINDS: dict[str, Kind] = members(__name__, "KIND")
