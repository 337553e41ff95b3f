"""What recordings show by themselves, before any effect is tried: controller, transmission, what a rig repeats."""
