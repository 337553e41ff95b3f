"""What a comparison names when something is hidden, and whether anything when nothing is: the rates of `comparison`.

    pytest -m study -s tests/comparison/test_study.py

See support/studied.py for where its rows are kept, and for the quick form.
"""

from __future__ import annotations

import pytest
from support.studied import studied

pytestmark = pytest.mark.study

RIGHT = {
    "cogging_torque": lambda row: row["variable"] == "motor_angle",
    "viscous_friction": lambda row: row["variable"] == "motor_speed",
    "hinge_moment": lambda row: row["variable"] == "user_position",
    "load_dependent_friction": lambda row: row["variable"] in ("load", "current") and row["modulator"] == "sign_speed",
}


def test_nothing_hidden_is_adequate():
    rows = [row for group, its in studied("comparison").items() if group not in RIGHT for row in its]
    alarms = [row for row in rows if not row["adequate"]]
    print(f"\nnothing hidden: adequate in {len(rows) - len(alarms)} of {len(rows)}")
    for row in alarms:
        print("  false alarm:", row["group"], row["seed"], row["sentence"])
    assert len(alarms) <= 0.02 * len(rows)


@pytest.mark.parametrize("name", RIGHT)
def test_the_right_variable_is_first(name):
    rows = studied("comparison")[name]
    right = sum(RIGHT[name](row) for row in rows)
    print(f"\n{name}: right in {right} of {len(rows)}")
    for row in rows:
        if not RIGHT[name](row):
            print(f"  {row['case']}, seed {row['seed']}: {row['variable']} × {row['modulator']}")
    if name == "cogging_torque":
        for case in {row["case"] for row in rows}:
            its = [row["orders"][:1] == [12.0] for row in rows if row["case"] == case]
            assert sum(its) >= 0.9 * len(its)
    assert right >= 0.95 * len(rows)
