"""From a calibrated model to a verdict, step by step: what is added, weighed again and taken out."""
