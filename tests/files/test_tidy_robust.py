"""The long table of a report whose results were edited by hand."""

import numpy as np

from rotcli.files.tables import Column, Table
from rotcli.files.tables.tidy import to_tidy


def test_a_text_in_a_column_of_numbers_is_not_known():
    columns = (Column("error"), Column("rate (deg/s)", ".0f"), Column("value, m", ".2f"))
    table = Table("errors", columns, [("height", "x", 1.5), ("east", 10.0, "")])
    frame = to_tidy([table])
    assert frame["value"].dtype == float
    assert 1.5 in frame["value"].tolist()
    assert np.isnan(frame["sigma"]).all()
