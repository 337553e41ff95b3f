"""A discovery as it is shown: in words, numbers, tables and lines over time."""
