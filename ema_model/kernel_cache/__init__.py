"""Compiled kernels between runs: where they lie, whose that place is, and files that are read only when whole."""
