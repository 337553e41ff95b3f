"""A discovery told as a recording."""
