"""Where a quantity sits, which decides its name and unit where an actuator's axes are linear.

The motor and the user's side of the transmission each have an axis.  NEITHER is said of an angle that is of no axis,
as a phase in a period, which stays an angle on every actuator.
"""

from __future__ import annotations

from typing import Literal

Side = Literal["motor", "user", "neither"]

MOTOR: Side = "motor"
USER: Side = "user"
NEITHER: Side = "neither"
