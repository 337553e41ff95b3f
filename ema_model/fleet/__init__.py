"""One model of many units: which parameters they share, in which they differ, what the type's tolerances are.

Each unit's recordings are simulated once, for what they tell of its parameters (`block`); all that is asked about
sharing is then linear algebra over these blocks, whose cost grows linearly with the units.
"""
