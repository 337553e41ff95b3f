"""The corrected model for other tools: C, FMU, MJCF and Python, each replayed on recordings with its loss."""
