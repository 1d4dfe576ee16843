"""A simulated voyage as files: logs, rig, scenario, and the truth."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli import units
from rotcli.files.columns import write_column_chunks, write_columns
from rotcli.files.results.documents import document, write_error, write_result, write_text
from rotcli.files.simulation_folder import MARKS, lock_simulation_folder
from rotcli.lazy import lazily
from rotcli.logs.record import Progress, ReferenceLog
from rotcli.srins.voyage import simulate
from rotcli.srins.voyage.scenario import SrinsScenario

with lazily():
    import tomlkit

KIND = "simulation"
_ARCSEC = units.UNITS["angle"]["arcsec"]
_REFERENCE_UNITS = {"latitude": ("deg", units.DEG), "longitude": ("deg", units.DEG)}


def voyage_files(suffix: str) -> list[str]:
    """Return the names of a voyage's files; truth.json, written last, comes last."""
    logs = [f"{name}.{suffix}" for name in ("imu", "table", "gnss", "doppler", "truth")]
    return [*logs, "rig.toml", "scenario.toml", "truth.json"]


def write_voyage(
    folder: str, scenario: SrinsScenario, suffix: str, progress: Progress | None
) -> None:
    """Write imu, table, gnss, doppler and truth logs, rig.toml, scenario.toml and truth.json.

    The IMU log is written as it is made; `progress` receives the share (0 to 1). The rig comes
    first, truth.json last: a folder that has it is complete. Raises ResultError, also for a folder
    that contains files of other origin.
    """
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise write_error(folder, fault) from fault
    with lock_simulation_folder(place, [place / name for name in voyage_files(suffix)[:-1]]):
        _write_files(place, scenario, suffix, progress)
        doc = document(KIND, [], rig_of(scenario), truth_of(scenario))
        write_result(str(place / "truth.json"), doc)


def _write_files(
    place: Path, scenario: SrinsScenario, suffix: str, progress: Progress | None
) -> None:
    write_text(str(place / "rig.toml"), _toml(f"{MARKS[1].decode()}.", rig_of(scenario)))
    write_column_chunks(place / f"imu.{suffix}", _imu_parts(scenario, progress))
    table = simulate.table_log(scenario)
    write_columns(
        place / f"table.{suffix}",
        {"time [s]": table.time, "angle [deg]": np.round(table.angle / units.DEG, 9) % 360.0},
    )
    for name, log in (
        ("gnss", simulate.gnss_log(scenario)),
        ("doppler", simulate.doppler_log(scenario)),
        ("truth", simulate.truth_log(scenario)),
    ):
        write_columns(place / f"{name}.{suffix}", _reference_columns(log))
    write_text(str(place / "scenario.toml"), _toml("# Made with this scenario.", scenario.source))


def _imu_parts(
    scenario: SrinsScenario, progress: Progress | None
) -> Iterator[dict[str, NDArray[Any]]]:
    for chunk in simulate.imu_chunks(scenario):
        columns = {"time [s]": chunk.time}
        for name, unit, values in (("gyro", "rad/s", chunk.gyro), ("accel", "m/s^2", chunk.accel)):
            for k, axis in enumerate("xyz"):
                columns[f"{name}_{axis} [{unit}]"] = values[:, k]
        yield columns
        if progress:
            progress(float(chunk.time[-1]) / scenario.duration)


def _reference_columns(log: ReferenceLog) -> dict[str, NDArray[Any]]:
    columns = {"time [s]": log.time}
    for name, values in log.values.items():
        unit, factor = _REFERENCE_UNITS.get(name, ("m/s", 1.0))
        columns[f"{name} [{unit}]"] = values / factor
    return columns


def rig_of(scenario: SrinsScenario) -> dict[str, Any]:
    """Return the rig of the navigation computer, with the errors of the alignment in it."""
    pitch, roll, azimuth = scenario.alignment

    def deg(angle: float) -> float:
        return float(np.round(angle / units.DEG, 12))

    return {
        "site": {
            "latitude": deg(scenario.latitude),
            "longitude": deg(scenario.longitude),
            "height": 0.0,
        },
        "attitude": {
            "pitch": deg(pitch),
            "roll": deg(roll),
            "azimuth": deg(scenario.azimuth + azimuth),
        },
        "imu": {
            "name": "SRINS",
            "sampling": "average",
            "angle_random_walk": _figure(scenario.gyro.noise, units.DEG_PER_ROOT_HOUR),
            "velocity_random_walk": _figure(
                scenario.accel.noise, units.METRE_PER_SECOND_PER_ROOT_HOUR
            ),
        },
        "table": {"axis": "z", "direction": 1, "column": "angle", "units": "deg"},
    }


def _figure(noise: dict[str, float], unit: float) -> float:
    return float(f"{noise.get('white', 0.0) / unit:.12g}")


def truth_of(scenario: SrinsScenario) -> dict[str, Any]:
    """Return the truth: sensor errors by the filter's names, and the matrices."""
    bias = scenario.gyro.bias / units.DEG_PER_HOUR
    return {
        "scenario": scenario.source,
        "seed": scenario.seed,
        "sensor_errors": {
            **{f"gyro_bias_{axis}": bias[k] for k, axis in enumerate("xyz")},
            **{f"accel_bias_{axis}": scenario.accel.bias[k] for k, axis in enumerate("xyz")},
        },
        "sensor_error_units": {"gyro_bias": "deg/h", "accel_bias": "m/s^2"},
        "gyro_matrix_ppm": scenario.gyro.matrix / units.PPM,
        "accel_matrix_ppm": scenario.accel.matrix / units.PPM,
        "alignment_arcsec": [angle / _ARCSEC for angle in scenario.alignment],
        "azimuth_deg": scenario.azimuth / units.DEG,
    }


def _toml(comment: str, values: dict[str, Any]) -> str:
    return f"{comment}\n" + tomlkit.dumps(values)
