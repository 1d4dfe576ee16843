"""Every faulted log of the shared cases gives navigation its right verdict.

`navigate --mode full` with the calibration of the clean run, as the cases' page says: S silent,
W a warning, R an error; several letters: either. Needs the folder ROTCLI_SHARED.
"""

import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

import pytest

from rotcli import public
from rotcli.errors import RotcliError
from rotcli.navigate.api import NavigateOptions
from rotcli.simulate.api import SimulateOptions

ROOT = Path(__file__).parents[2]
MAKER = (
    Path(os.environ.get("ROTCLI_SHARED", ROOT.parent / "shared")) / "cases/faults/make_faults.py"
)
# What a wrong column or an encoder that wraps elsewhere does is decided when a log is read.
_READING = ("columns_", "wrap_")


def _maker() -> ModuleType | None:
    if not MAKER.is_file():
        return None
    spec = importlib.util.spec_from_file_location("make_faults", MAKER)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["make_faults"] = module
    spec.loader.exec_module(module)
    return module


FAULTS = _maker()
RIGHT = {
    name: right
    for name, fault in (FAULTS.FAULTS.items() if FAULTS else ())
    if (right := dict(w.split("=") for w in fault.right.split()).get("n", "-")) != "-"
    and not name.startswith(_READING)
}


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("clean")
    public.simulate(SimulateOptions(imu="nav440", rate=30.0, seed=1)).write(str(path))
    public.calibrate(path / "imu.parquet", path / "table.parquet").write(str(path / "c.json"))
    return path


@pytest.mark.campaign
@pytest.mark.skipif(FAULTS is None, reason=f"{MAKER} is absent; set ROTCLI_SHARED")
@pytest.mark.parametrize("name", RIGHT)
def test_a_faulted_log_gets_its_right_verdict(clean, tmp_path, name):
    FAULTS.make(name, clean, tmp_path)
    logs = [next(tmp_path.glob(f"{log}.*")) for log in ("imu", "table")]
    settings = NavigateOptions(("full",))
    verdict, texts = _verdict(logs, clean / "c.json", settings)
    assert verdict in RIGHT[name], texts


def _verdict(logs: list[Path], calibration: Path, settings: NavigateOptions) -> tuple[str, object]:
    """Return R, W or S and the texts."""
    try:
        result = public.navigate(
            *logs, calibration=calibration, options=settings, keep_series=False
        )
    except RotcliError as error:
        return "R", str(error)
    warnings = result["full"].document["warnings"]
    return ("W" if warnings else "S"), warnings
