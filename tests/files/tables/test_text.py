import textwrap

import pytest

from rotcli.files.tables import Column, Estimate, Table, with_values
from rotcli.files.tables.model import BY_SIGMA
from rotcli.files.tables.text import to_text


def wide(columns=9, rows=3):
    heads = (Column("IMU"), Column("mode"), Column("rate, deg/s", ".4g"))
    heads += tuple(Column(f"quantity number {k}, deg/sqrt(h)", ".3f") for k in range(columns))
    lines = [
        (f"unit-{r}", "conventional", 10.0 * r, *(100.0 * k + r for k in range(columns)))
        for r in range(rows)
    ]
    return Table("A wide table", heads, lines, "A note. " * 20)


@pytest.mark.parametrize("width", [40, 60, 80, 100, 132, 200])
def test_no_line_is_wider_than_the_terminal_and_nothing_is_lost(width):
    table = wide()
    text = to_text(table, width)
    assert max(map(len, text.splitlines())) <= width
    for row in table.shown:
        for cell in row:
            assert cell in text
    assert text.count("unit-1") >= 1


def test_the_columns_that_name_a_row_are_repeated_in_each_block():
    blocks = to_text(wide(), 60).split("\n\n")
    assert len(blocks) > 1
    assert all("unit-0" in block and "IMU" in block for block in blocks)


def test_a_table_that_fits_is_one_block_with_headings_in_one_line():
    table = Table("T", (Column("IMU"), Column("x, m", ".1f")), [("A", 1.0)])
    assert to_text(table, 80) == "T\nIMU  x, m\n---  ----\nA     1.0\n"


def test_long_names_continue_on_further_lines_and_stay_distinct():
    names = [f"campaign/2026-11-28/device-{k}/turn-on-1/calibration.json" for k in (1, 2)]
    reason = "no: the innovations contradict the sigmas: mean NIS 14.2, limit 3.1"
    rows = [(name, 1.0, reason) for name in names]
    table = Table("Results", (Column("file"), Column("value", ".2f"), Column("use")), rows)
    text = to_text(table, 60)
    assert max(map(len, text.splitlines())) <= 60
    joined = "".join(line[:30].split("  ")[0].strip() for line in text.splitlines())
    for name in names:
        assert name in joined.replace(" ", "")
    assert len(textwrap.dedent(text).splitlines()) > 4


def test_an_estimate_has_two_digits_of_its_sigma_or_its_limit():
    column = Column("K, ppm", BY_SIGMA)
    assert column.show(Estimate(-907.3622, 434.0)) == "-907 ± 434"
    assert column.show(Estimate(0.40282, 0.00177)) == "0.4028 ± 0.0018"
    assert column.show(Estimate(3.0, None)) == "3"
    assert column.show(Estimate(None, None, 0.6476)) == "< 0.65"
    assert column.show(Estimate(None, None, 203.1)) == "< 200"
    assert column.show(Estimate(None)) == "-"


def test_rows_without_a_value_are_left_out():
    columns = (Column("IMU"), Column("axis"), Column("N, deg/sqrt(h)", BY_SIGMA))
    rows = [("A", "x", Estimate(None)), ("A", "y", Estimate(1.0, 0.1)), ("A", "z", None)]
    table = with_values(Table("T", columns, rows, origins=[("a",), ("b",), ("c",)]))
    assert [row[1] for row in table.rows] == ["y"]
    assert table.origins == [("b",)]
