"""The actuator in 3D."""
