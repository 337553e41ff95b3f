"""Quantities: signals, units, titles and axes, each fact in one row."""
