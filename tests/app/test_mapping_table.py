"""What the mapping step's table tells of a column, beside its unit."""

from __future__ import annotations

import pytest

from ema_model.recordings import ColumnMapping, MappedColumn
from emaviz.page.compare.files import mapping_table


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ({}, "← iq<"),
        ({"sign": -1}, "← iq × −1<"),
        ({"sign": -1, "scale": 2.5, "offset": -0.1}, "← iq × −2.5 − 0.1<"),
        ({"delay_s": 0.005}, "← iq, 5 ms late<"),
        ({"offset": 0.2, "delay_s": -1.5e-4}, "← iq + 0.2, 0.15 ms early<"),
    ],
)
def test_what_is_done_to_a_column_is_told(numbers, told):
    assert told in str(mapping_table(ColumnMapping((MappedColumn("current_A", "iq", **numbers),))))
