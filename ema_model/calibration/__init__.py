"""Calibration: the actuator's own parameters, fitted to recordings within their tolerances."""
