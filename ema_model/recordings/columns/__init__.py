"""Which column of a file is which signal: names, units, guesses and mappings."""
