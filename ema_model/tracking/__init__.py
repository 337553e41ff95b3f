"""k over the flights of one unit: what drifts, what jumped, and what life remains."""
