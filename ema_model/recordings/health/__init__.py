"""Data health: what a recording's own numbers say about its sampling, sensors, signs and limits."""
