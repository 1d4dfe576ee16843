"""One function for each reader of files: takes the bytes of a file, expects RotcliError at worst.

`seeds` gives the files that fuzzing starts from. A crasher is a file in fixtures/crashers/READER.
"""

import copy
import importlib.util
import json
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rotcli.errors import RotcliError
from rotcli.export import figures
from rotcli.export.formats import all_formats, render
from rotcli.export.numbers import Settings
from rotcli.export.thermal import Source
from rotcli.files.formats import FORMATS
from rotcli.files.results.documents import read_result
from rotcli.files.spec import read_spec
from rotcli.files.tables.save import csv_text
from rotcli.fleet import scan
from rotcli.fleet.records import Folders
from rotcli.logs.imu import read_imu, read_reference
from rotcli.logs.inspect import inspect_log
from rotcli.logs.readings import read_readings
from rotcli.logs.stream import open_imu
from rotcli.logs.table import read_table
from rotcli.logs.table_axes import read_table_axes
from rotcli.navigate.plot import ERROR_COLUMNS
from rotcli.navigate.solution import read_solution
from rotcli.report import render as render_report
from rotcli.report import report
from rotcli.rig import allan_figures
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import ImuSettings, read_rig, rig_from_dict
from rotcli.rig.scenario import read_scenario
from rotcli.rig.sequence import read_sequence, sequence_text
from rotcli.run.correction import read_correction
from rotcli.run.corrections import read_corrections
from rotcli.srins.api import read_truth
from rotcli.srins.voyage.scenario import read_srins_scenario
from rotcli.triad.api import merge_calibrations

ROOT = Path(__file__).parents[3]
FIXTURES = ROOT / "fixtures"
CRASHERS = FIXTURES / "crashers"
_MOST = 20_000_000  # bytes that a log may hold here
_RIGS = ({}, {"imu": {"format": "xsens"}}, {"imu": {"format": "euroc"}},
         {"imu": {"format": "kf-gins"}}, {"imu": {"format": "psins"}},
         {"imu": {"sampling": "increment", "clock": "stamps"}})  # fmt: skip


@contextmanager
def _file(data: bytes, suffix: str) -> Iterator[Path]:
    place = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with tempfile.NamedTemporaryFile(suffix=suffix, dir=place) as stream:
        stream.write(data)
        stream.flush()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield Path(stream.name)


def _ours(call: Callable[..., Any], *args: Any, **options: Any) -> Any:
    try:
        return call(*args, **options)
    except RotcliError as error:
        assert str(error), "an error without a word"
        return None


def csv(data: bytes) -> None:
    """Read a text log, as an IMU's in several formats, a table's and a reference's."""
    _logs(data, ".csv", _RIGS)


def parquet(data: bytes) -> None:
    """Read a Parquet log."""
    _logs(data, ".parquet", _RIGS[:1])


def _logs(data: bytes, suffix: str, rigs: Any) -> None:
    with _file(data, suffix) as path:
        for settings in rigs:
            _ours(read_imu, path, rig_from_dict(settings), max_gap=None, max_bytes=_MOST)
        _ours(read_table, path, rig_from_dict({}), max_bytes=_MOST)
        _ours(read_reference, path)


def formats(data: bytes) -> None:
    """Read a text log as each of the vendor formats, by axes of a table, and inspect it."""
    with _file(data, ".txt") as path:
        for name in FORMATS:
            _ours(read_imu, path, rig_from_dict({"imu": {"format": name}}), max_bytes=_MOST)
        _ours(open_imu, path, rig_from_dict({}), max_bytes=_MOST)
        _ours(read_readings, path, rig_from_dict({}), max_bytes=_MOST)
        for axes in (["z"], ["z", "x", "y"]):
            _ours(read_table_axes, path, rig_from_dict({"table": {"axes": axes}}), max_bytes=_MOST)
        for kind in (None, "imu", "table"):
            _ours(inspect_log, path, rig_from_dict({}), kind, max_bytes=_MOST)


def spec(data: bytes) -> None:
    """Read a specification with limits."""
    with _file(data, ".toml") as path:
        _ours(read_spec, str(path))


def sequence(data: bytes) -> None:
    """Read a sequence of table motions, and write it back."""
    with _file(data, ".toml") as path:
        found = _ours(read_sequence, str(path))
    if found is not None:
        with _file(sequence_text(found).encode(), ".toml") as path:
            again = read_sequence(str(path))
        assert len(again.steps) == len(found.steps)


def rig(data: bytes) -> None:
    """Read a rig, and write it back."""
    with _file(data, ".toml") as path:
        found = _ours(read_rig, path)
    if found is not None:
        assert rig_from_dict(found.effective()).effective() == found.effective()


def scenario(data: bytes) -> None:
    """Read a scenario of either kind and an IMU profile."""
    with _file(data, ".toml") as path:
        _ours(read_scenario, str(path))
        _ours(read_srins_scenario, str(path))
        _ours(read_profile, str(path))


def result(data: bytes) -> None:
    """Read a result: into a report in every text form, as a calibration, as noise figures.

    Bytes that do not begin with `{` say where a sound result is changed, and into what.
    """
    if not data.startswith(b"{"):
        data = changed(data)
    with _file(data, ".json") as path:
        found = _ours(report.gather, [str(path)], "fuzz")
        if found is not None:
            _ours(render_report.as_text, found, 100)
            for show in (render_report.as_markdown, render_report.as_latex):
                _ours(show, found)
            _ours(csv_text, render_report.as_frame(found))
        correction = _ours(read_correction, str(path))
        if correction is not None:
            _ours(correction.gyro_errors, full=True)
        _ours(read_corrections, [str(path)])
        _ours(_export, str(path))
        _ours(merge_calibrations, [str(path)] * 3)
        _ours(scan.to_frame, scan.read_chunk([str(path)], Folders(None), frozenset()))
        _ours(allan_figures.with_allan, str(path), ImuSettings())
        _ours(read_truth, str(path))


def _export(path: str) -> None:
    """Write the figures of a result in every format of other programs."""
    doc = read_result(path)
    found = figures.collect([(Source(path, str(doc["kind"]), "0" * 64), doc)])
    for name in all_formats():
        _ours(render, name, found, Settings())


def solution(data: bytes) -> None:
    """Read a solution, as CSV and as Parquet."""
    for suffix in (".csv", ".parquet"):
        with _file(data, suffix) as path:
            _ours(read_solution, str(path))


READERS: dict[str, Callable[[bytes], None]] = {
    "csv": csv,
    "formats": formats,
    "parquet": parquet,
    "rig": rig,
    "scenario": scenario,
    "sequence": sequence,
    "spec": spec,
    "result": result,
    "solution": solution,
}
_NAMES = "time [s],gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
_ROW = "{t},0.1,0.2,0.3,0.1,0.2,9.8"
# A few records each: names in quotes, vendors' heads, numbers alone, blanks, decimal commas.
VENDOR_LOGS = (
    "\n".join([_NAMES, *(_ROW.format(t=0.01 * k) for k in range(40))]),
    "\n".join(['"' + _NAMES.replace(",", '","') + '"', *(_ROW.format(t=k) for k in range(9))]),
    "// Start Time: Unknown\n// Update Rate: 100.0Hz\nPacketCounter\tSampleTimeFine\tGyr_X\tGyr_Y\t"
    "Gyr_Z\tAcc_X\tAcc_Y\tAcc_Z\n"
    + "\n".join(f"{k}\t{k * 100}\t0.1\t0.2\t0.3\t0\t0\t9.8" for k in range(9)),
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
    + "\n".join(f"{1403636579758555392 + 5000000 * k},0.1,0.2,0.3,0,0,9.8" for k in range(9)),
    "\n".join(f"{0.005 * k:.3f} 1e-5 2e-5 3e-5 1e-5 2e-5 0.049" for k in range(30)),
    "\n".join(
        f"%RAWIMUSA,2000,{345600 + 0.01 * k:.2f};2000,{345600 + 0.01 * k:.9f},00000077,"
        "1638,-20,30,1,2,3*aabbccdd"
        for k in range(9)
    ),
    "time;gyro_x;gyro_y;gyro_z;accel_x;accel_y;accel_z\n"
    + "\n".join(f"{k},0;0,1;0,2;0,3;0,0;0,0;9,8" for k in range(9)),
    "time,outer,middle,inner\n" + "\n".join(f"{0.02 * k},{k},0,{2 * k}" for k in range(40)),
)
SPEC = (
    b'[limits.bias_x]\nunit = "deg/h"\nmin = -10\nmax = 10\nguard = 1.0\n[fleet]\npath = "{unit}"\n'
)
SEQUENCES = (
    "axes = ['z', 'x', 'y']\nacceleration = 20.0\nslew_rate = 20\n[[steps]]\ngo = [0, 45, 45]\n"
    "[[steps]]\nhold = 30\n[[steps]]\nspin = 'outer'\nrate = 100\nturns = 4\nboth = true\n"
    "[errors]\ngsens_xx = 10.0\n",
    "[[steps]]\nhold = 1\n[[steps]]\nmount = 2\n[[steps]]\nspin = 'axis'\nrate = 5\nturns = 0.5\n"
    "[[mountings]]\nmount = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]\n",
)
_ODD: tuple[Any, ...] = (
    *(None, True, 0, -1, 1e308, -1e-300, 1e400, 10**400, "", "x", "é\n<script>\\input{x}", [], {}),
    *([1, 2], [None], ["a"], {"a": 1}, {"value": "x"}, {"value": None, "unit": 3}, [[]], [{}]),
    {"value": 1, "sigma": "x", "unit": []},
)


def changed(data: bytes) -> bytes:
    """Return a sound result with up to four places changed, as the bytes say."""
    docs = result_documents()
    rest = list(data) or [0]

    def pick(count: int) -> int:
        value = rest.pop(0) if rest else 0
        return value % count if count else 0

    doc = json.loads(json.dumps(docs[pick(len(docs))]))
    for _ in range(1 + pick(4)):
        places = list(_places(doc))
        holder, key = places[(pick(256) * 256 + pick(256)) % len(places)]
        if key in holder or not isinstance(holder, dict):
            if pick(4) == 0:
                del holder[key]
            else:
                holder[key] = copy.deepcopy(_ODD[pick(len(_ODD))])
        if not doc:
            break
    return json.dumps(doc).encode()


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    keys = list(value) if isinstance(value, dict) else range(min(len(value), 3))
    for key in keys:
        yield value, key
        if isinstance(value[key], dict | list):
            yield from _places(value[key])


_made: list[dict[str, Any]] = []


def result_documents() -> list[dict[str, Any]]:
    """Return small results of every kind, made by the program itself and by the tests' makers."""
    if not _made:
        path = ROOT / "tests" / "documents.py"
        spec = importlib.util.spec_from_file_location("documents", path)
        assert spec is not None
        assert spec.loader is not None
        makers = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(makers)
        _made.append(makers.navigation("NAV440", "full", 10.0, 3.0, 4.0))
        _made.extend(json.loads(p.read_text()) for p in sorted((CRASHERS / "seeds").glob("*.json")))
    return _made


def seeds(reader: str) -> list[bytes]:
    """Return the files that the fuzzing of a reader starts from."""
    if reader == "csv":
        found = [b"".join(p.read_bytes().splitlines(keepends=True)[:40]) for p in
                 (*sorted(FIXTURES.glob("*.csv")), *sorted(FIXTURES.glob("*/*.csv")))]  # fmt: skip
        return [*found, b"time,angle\n0,0\n0.02,1\n0.04,359\n", b"time,latitude\n0,1\n1,2\n"]
    if reader == "formats":
        return [text.encode() for text in VENDOR_LOGS]
    if reader == "spec":
        return [SPEC]
    if reader == "sequence":
        return [text.encode() for text in SEQUENCES]
    if reader == "parquet":
        return [_small_parquet()]
    if reader == "rig":
        return [p.read_bytes() for p in (*FIXTURES.glob("*.toml"), *FIXTURES.glob("*/rig.toml"))]
    if reader == "scenario":
        profiles = (ROOT / "rotcli" / "data" / "profiles").glob("*.toml")
        text = b'profile = "ideal"\nramp = 1.0\n[[leg]]\nduration = 5\nrate = 2.0\nsweep = 1\n'
        voyage = b"scenario = 'srins'\nduration = 1.5\nseed = 1\n[rotation]\nkind = 'one-stop'\n"
        return [text, voyage, *(p.read_bytes() for p in profiles)]
    if reader == "solution":
        return [_small_solution(parquet=kind) for kind in (True, False)]
    return [bytes([k, 0, 0, 0, 1, 0]) for k in range(len(result_documents()))] + [
        json.dumps(doc).encode() for doc in result_documents()
    ]


def _small_parquet() -> bytes:
    import io

    import pyarrow as pa
    import pyarrow.parquet as pq

    names = ["time [s]", *(f"gyro_{a} [deg/s]" for a in "xyz"), *(f"accel_{a} [g]" for a in "xyz")]
    table = pa.table({n: [0.01 * k for k in range(1, 9)] for n in [*names, "angle"]})
    stream = io.BytesIO()
    pq.write_table(table, stream, compression="none")
    return stream.getvalue()


def _small_solution(*, parquet: bool) -> bytes:
    import io

    import pyarrow as pa
    import pyarrow.csv as pc
    import pyarrow.parquet as pq

    stream = io.BytesIO()
    table = pa.table({name: [0.0, 0.5, 1.0] for name in ERROR_COLUMNS})
    if parquet:
        pq.write_table(table, stream, compression="none")
    else:
        pc.write_csv(table, stream)
    return stream.getvalue()
