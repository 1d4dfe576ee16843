"""Every faulted run of the shared cases gets its right verdict from calibrate, navigate, observe.

`navigate --mode full` uses the calibration of the clean run, as the page of the cases says. S:
silent, W: a warning, R: an error; several letters: either. Still logs are in tests/allan.
"""

import importlib.util
import sys

import pytest

from tests.recorded import SHARED

MAKER = SHARED / "cases" / "faults" / "make_faults.py"
COMMANDS = {"c": "calibrate", "n": "navigate", "o": "observe"}
# These logs are read as they are meant, with a warning that names the fault and the line to set;
# the page was written for a program that cannot read them.
READ_RIGHT = dict.fromkeys(("columns_numbers", "wrap_327.68", "wrap_720"), "W")


def _maker():
    if not MAKER.is_file():
        return None
    spec = importlib.util.spec_from_file_location("make_faults", MAKER)
    module = importlib.util.module_from_spec(spec)
    sys.modules["make_faults"] = module
    spec.loader.exec_module(module)
    return module


FAULTS = _maker()
RIGHT = {
    (name, command): READ_RIGHT.get(name, right)
    for name, fault in (FAULTS.FAULTS.items() if FAULTS else ())
    for letter, right in (word.split("=") for word in fault.right.split())
    if right != "-" and (command := COMMANDS.get(letter))
}


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    from rotcli import public

    path = tmp_path_factory.mktemp("clean")
    options = public.SimulateOptions(imu="nav440", rate=30.0, seed=1)
    public.simulate(options).write(str(path))
    public.calibrate(path / "imu.parquet", path / "table.parquet").write(str(path / "c.json"))
    return path


@pytest.mark.campaign
@pytest.mark.skipif(FAULTS is None, reason=f"{MAKER} is absent; set ROTCLI_SHARED")
@pytest.mark.parametrize(("name", "command"), RIGHT)
def test_a_faulted_run_gets_its_right_verdict(rotcli, clean, tmp_path, name, command):
    FAULTS.make(name, clean, tmp_path)
    logs = [next(tmp_path.glob(f"{log}.*")) for log in ("imu", "table")]
    more = ("--mode", "full", "--calibration", clean / "c.json") if command == "navigate" else ()
    done = rotcli(command, *logs, *more, "-o", tmp_path / "result.json")
    said = [line for line in done.err.splitlines() if "warning: " in line or "error: " in line]
    verdict = "R" if done.status else "W" if said else "S"
    assert verdict in RIGHT[name, command], said


NAMED = {
    "gyro_z_57_large": "gyro_z is in deg/s and read as rad/s; set [imu] scale = { gyro = [1, 1, ",
    "table_11.8s": "one record in 11.8 s, and the gyros turn",
    "table_12.2s": "complete turns are lost between records. Log the table faster",
}


@pytest.mark.campaign
@pytest.mark.skipif(FAULTS is None, reason=f"{MAKER} is absent; set ROTCLI_SHARED")
@pytest.mark.parametrize("command", COMMANDS.values())
@pytest.mark.parametrize("name", NAMED)
def test_the_error_names_the_fault(rotcli, clean, tmp_path, name, command):
    FAULTS.make(name, clean, tmp_path)
    logs = [next(tmp_path.glob(f"{log}.*")) for log in ("imu", "table")]
    more = ("--mode", "full", "--calibration", clean / "c.json") if command == "navigate" else ()
    done = rotcli(command, *logs, *more, "-o", tmp_path / "result.json")
    assert done.status == 1
    assert NAMED[name] in done.err
