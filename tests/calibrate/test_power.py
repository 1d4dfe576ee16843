"""The page of the power of the tests is what the program gives: a few rows, computed again."""

import pytest

from tests.campaigns.power import CASES, COLUMNS, PAGE, size_found

# Index of the case, column: quick ones of each kind.
_AGAIN = [("rows of zeros", 0), ("table stamps late", 2), ("leap of the table angle", 1)]


def _row(error):
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if error in cells:
            return cells
    raise AssertionError(f"{error} is not in {PAGE}")


def test_the_page_has_every_case():
    for case in CASES:
        row = _row(case.error)
        assert len(row) == 4 + len(COLUMNS)
        assert all(row)


@pytest.mark.campaign
@pytest.mark.parametrize(("error", "column"), _AGAIN)
def test_a_size_of_the_page_is_found_again(error, column):
    case = next(c for c in CASES if c.error == error and c.command == "calibrate")
    profile, rate = COLUMNS[column]
    shown = float(_row(error)[3 + column])
    assert size_found(case, profile, rate) == pytest.approx(shown, rel=0.02)
