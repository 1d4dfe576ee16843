"""Deviations of the NIST SP 1065 test suite: fixtures/authorities/nist_sp1065.csv."""

import csv
from pathlib import Path

import numpy as np
import pytest

from rotcli.allan.deviation import ESTIMATORS, deviation, phase_from_rate

AUTHORITY = Path(__file__).parents[2] / "fixtures" / "authorities" / "nist_sp1065.csv"
ROWS = list(csv.DictReader(AUTHORITY.read_text().splitlines()[1:]))
NBS14 = np.array([892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0])
# Misprinted by one in the last digit; see SOURCE.
MISPRINTED = {("nbs14", "hdev", "1"), ("lcg1000", "hdev", "100")}
# What the source's bias correction for white noise divides the variance by.
CORRECTED = {"mtotdev": 0.73, "ttotdev": 0.73, "htotdev": 0.995}


def generated():
    numbers = [1234567890]
    while len(numbers) < 1000:
        numbers.append(16807 * numbers[-1] % 2147483647)
    assert numbers[1:4] == [395529916, 1209410747, 633705974]
    return np.array(numbers) / 2147483647.0


DATA = {"nbs14": NBS14, "lcg1000": generated()}


def last_digit(printed):
    mantissa, _, exponent = printed.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def ids(rows):
    return [f"{r['data']}-{r['statistic']}-{r['m']}" for r in rows]


OURS = [r for r in ROWS if r["statistic"] in (*ESTIMATORS, "tdev")]
OTHERS = [r for r in ROWS if r not in OURS]


@pytest.mark.parametrize("row", OURS, ids=ids(OURS))
def test_every_deviation_we_offer_has_all_the_printed_digits(row):
    m = int(row["m"])
    phase = phase_from_rate(DATA[row["data"]], 1.0)
    # The time deviation is the modified deviation times tau / sqrt(3) (SP 1065 (21)).
    name = "mdev" if row["statistic"] == "tdev" else row["statistic"]
    scale = m / np.sqrt(3.0) if row["statistic"] == "tdev" else 1.0
    value = scale * deviation(phase, np.array([m]), 1.0, name)[0]
    # Half a unit of the last printed digit: the source rounds.
    assert abs(value - float(row["printed"])) <= 0.5000001 * last_digit(row["printed"])


def _is_slow(row):
    """Return whether a total deviation of the 1000 points takes a second."""
    return row["data"] == "lcg1000" and row["m"] == "100" and row["statistic"] in _TOTAL


_TOTAL = ("mtotdev", "htotdev", "ttotdev")  # the library's; with m = 1 and 10 tried every time


@pytest.mark.parametrize(
    "row",
    [pytest.param(r, marks=pytest.mark.campaign if _is_slow(r) else ()) for r in OTHERS],
    ids=ids(OTHERS),
)
def test_the_library_behind_the_other_estimators_has_all_the_printed_digits(row):
    import allantools

    statistic, m = row["statistic"], int(row["m"])
    function = getattr(allantools, statistic)
    value = function(DATA[row["data"]], rate=1.0, data_type="freq", taus=[m])[1][0]
    if statistic in CORRECTED and not (statistic == "htotdev" and m == 1):
        value /= np.sqrt(CORRECTED[statistic])
    # The source's bias corrections are rounded themselves: one unit of the last digit.
    rounded = statistic in CORRECTED or (row["data"], statistic, row["m"]) in MISPRINTED
    digits = 1.0 if rounded else 0.5000001
    assert abs(value - float(row["printed"])) <= digits * last_digit(row["printed"])
