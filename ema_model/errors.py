"""What a user can do wrong, told in one line."""

from __future__ import annotations


class InputError(ValueError):
    """A user's mistake.  Its message is one line: what is wrong, where, and what to do about it."""
