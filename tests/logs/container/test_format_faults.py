"""Faults of vendors' logs: the message names row and column."""

import pytest

from rotcli.errors import LogError
from rotcli.logs.imu import read_imu
from tests.logs.container.test_formats import XSENS_HEAD, kf_gins, psins, put, rig, xsens

FAULTS = {
    "text in a cell": (
        "xsens",
        lambda: xsens().replace("\t0.003\t", "\t0.oo3\t", 3).replace("\t0.oo3\t", "\t0.003\t", 2),
        r"imu\.txt: row 8: Gyr_Z: '0\.oo3' is not a number; correct or remove",
    ),
    "an empty cell": (
        "xsens",
        lambda: xsens().replace("\t9.81\t0.004", "\t\t0.004"),
        r"row 10: Acc_Z: an empty cell",
    ),
    "not finite": (
        "xsens",
        lambda: xsens().replace("\t9.81\t0.004", "\tnan\t0.004"),
        r"row 10: Acc_Z: nan is not a finite number",
    ),
    "too few cells": (
        "xsens",
        lambda: xsens() + "00004\t600\n",
        r"row 14: 2 values, the header has 10: the row is truncated",
    ),
    "a column missing": (
        "xsens",
        lambda: xsens().replace("Gyr_Y", "Mag_Y"),
        r"no column gyro_y .the log has: PacketCounter",
    ),
    "no records": ("xsens", lambda: XSENS_HEAD, r"no data rows below the header"),
    "comments alone": ("xsens", lambda: "// Start Time\n", r"no rows of numbers; is this the"),
    "a time that goes back": (
        "kf-gins",
        lambda: kf_gins() + kf_gins(1),
        r"row 7: time: time goes back by 0\.025 s",
    ),
    "too many cells": (
        "kf-gins",
        lambda: kf_gins() + "456301 1 2 3 4 5 6 7\n",
        r"row 7: 8 values, the first record has 7: the row has one blank too many",
    ),
    "fewer columns than counted": (
        "kf-gins",
        lambda: "1 2 3 4 5 6\n2 3 4 5 6 7\n",
        r"accel_z: there is no column 7, the log has 6",
    ),
    "text among blanks": (
        "kf-gins",
        lambda: kf_gins().replace("2.0e-05 -3.0e-05", "2.0e-05 x", 4).replace("x", "-3.0e-05", 3),
        r"row 4: 4: 'x' is not a number",
    ),
    "a cut head": (
        "psins",
        lambda: psins()[: psins().index("0.100000")],
        r"the file ends before the 3 lines of numbers",
    ),
    "a head without factors": (
        "psins",
        lambda: psins().replace("0.100000 0.200000 0.400000 ", ""),
        r"row 7: 3 numbers in the head, 6 expected",
    ),
    "a factor of nothing": (
        "psins",
        lambda: psins().replace("0.200000", "0.000000"),
        r"row 7: a scale factor is not above 0",
    ),
    "no interval": (
        "psins",
        lambda: psins().replace(" 10.00000000 ", " 0.0 "),
        r"row 6: the interval is 0 ms",
    ),
    "a letter in the head": (
        "psins",
        lambda: psins().replace("9.780327", "9.780327f"),
        r"row 6: '9\.780327f' is not a number",
    ),
    "a cut record": (
        "psins",
        lambda: psins() + "1 2 3",
        r"row 15: 3 values, the first record has 6",
    ),
    "binary": ("xsens", lambda: b"\xfa\xff\x36\x00\x01", r"neither CSV .* nor Parquet"),
    "empty": ("psins", lambda: "", r"the file is empty"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_name_row_and_column(tmp_path, name):
    form, text, said = FAULTS[name]
    with pytest.raises(LogError, match=said):
        read_imu(put(tmp_path, text()), rig(form))
