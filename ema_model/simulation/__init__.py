"""Simulation: one run of a model, from a command, a load and faults to signals as sensors see them."""
