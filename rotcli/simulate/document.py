"""A simulation as files: the logs, the rig that describes them, and the truth."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from rotcli import units
from rotcli.files.columns import write_columns
from rotcli.files.results.documents import document, write_error, write_result, write_text
from rotcli.files.simulation_folder import MARKS, lock_simulation_folder
from rotcli.lazy import lazily
from rotcli.models.reading_effects import NO_EFFECTS
from rotcli.rig.profile import Triad
from rotcli.rig.rig import TableSettings, rig_from_dict
from rotcli.rig.scenario import Scenario
from rotcli.simulate.estimate import Simulation
from rotcli.units import FloatArray

with lazily():
    import tomlkit


KIND = "simulation"


def write_simulation(folder: str, scenario: Scenario, simulation: Simulation, suffix: str) -> None:
    """Write imu and table logs (`suffix` parquet or csv), rig.toml and truth.json into a folder.

    The rig comes first and says what the logs are, the truth last: a folder that has it is
    complete. Raises ResultError, also for a folder that contains logs or a rig of other origin.
    """
    place = Path(folder)
    truth = place / "truth.json"
    logs = [place / f"imu.{suffix}", place / f"table.{suffix}"]
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise write_error(folder, fault) from fault
    rig = _rig(scenario, simulation)
    with lock_simulation_folder(place, [*logs, place / "rig.toml"]):
        write_text(str(place / "rig.toml"), _toml(rig))
        write_columns(logs[0], _imu_columns(scenario, simulation))
        write_columns(logs[1], _table_columns(scenario, simulation))
        write_result(str(truth), document(KIND, [], rig, _truth(scenario, simulation)))


def _imu_columns(scenario: Scenario, simulation: Simulation) -> dict[str, Any]:
    imu = simulation.imu
    increments = scenario.rig.imu.sampling == "increment"
    scale = imu.interval if increments else 1.0
    gyro_unit, accel_unit = ("rad", "m/s") if increments else ("rad/s", "m/s^2")
    # What the IMU's own axes read, before the mount turns it into the sensor frame.
    mount = scenario.rig.imu.mount
    columns = {"time [s]": imu.time}
    for name, unit, values in (("gyro", gyro_unit, imu.gyro), ("accel", accel_unit, imu.accel)):
        own = values if np.array_equal(mount, np.eye(3)) else values @ mount.T
        for k, axis in enumerate("xyz"):
            columns[f"{name}_{axis} [{unit}]"] = own[:, k] * scale
    if simulation.temperature is not None:
        columns["temperature [degC]"] = simulation.temperature
    return columns


def _table_columns(scenario: Scenario, simulation: Simulation) -> dict[str, Any]:
    """Return the table's log: deg, wrapping at 360, counted in the table's own sense."""
    table = scenario.rig.table
    angle = table.direction * simulation.table.angle / units.DEG
    step = scenario.encoder_step / units.DEG
    if step:
        decimals = max(0, -int(np.floor(np.log10(step) + 1e-9)) + 2)
        angle = np.round(angle, decimals)
    return {
        f"{table.columns.get('time', 'time')} [s]": table_clock(simulation.table.time, table),
        f"{table.column} [deg]": angle % 360.0,
    }


def table_clock(time: FloatArray, table: TableSettings) -> FloatArray:
    """Return times (n,), s, as the table's own clock shows them: without offset and clock rate."""
    if not table.clock_rate:
        return time - table.time_offset
    return np.asarray(time[0] - table.time_offset + (time - time[0]) / (1.0 + table.clock_rate))


def _rig(scenario: Scenario, simulation: Simulation) -> dict[str, Any]:
    """Return the rig that describes the logs, in the keys and units of rig.toml."""
    pitch, roll, azimuth = (float(np.round(a / units.DEG, 12)) for a in scenario.attitude)
    site = scenario.site
    profile = scenario.profile
    figures = {
        "angle_random_walk": profile.gyro.noise.get("white", 0.0) / units.DEG_PER_ROOT_HOUR,
        "bias_instability": profile.gyro.noise.get("bias_instability", 0.0) / units.DEG_PER_HOUR,
        "velocity_random_walk": profile.accel.noise.get("white", 0.0)
        / units.METRE_PER_SECOND_PER_ROOT_HOUR,
        "rate_random_walk": profile.gyro.noise.get("rate_random_walk", 0.0) / units.DEG_PER_HOUR,
        "accel_bias_instability": profile.accel.noise.get("bias_instability", 0.0),
        "scale_sigma": float(f"{np.sqrt(np.mean(profile.gyro.matrix**2)) / units.PPM:.1g}"),
        "gyro_range": profile.gyro.range and profile.gyro.range / units.DEG,
    }
    stages: dict[str, Any] = {
        name: list(windows[0]) if len(windows) == 1 else [list(w) for w in windows]
        for name, windows in simulation.stages.items()
    }
    own = scenario.rig.effective()
    own["site"] = {
        "latitude": float(np.round(site.latitude / units.DEG, 12)),
        "longitude": float(np.round(site.longitude / units.DEG, 12)),
        "height": site.height,
        **({} if site.gravity is None else {"gravity": site.gravity}),
    }
    own["attitude"] = {"pitch": pitch, "roll": roll, "azimuth": azimuth}
    own["imu"] = {
        **own.get("imu", {}),
        "name": profile.name,
        **{key: float(f"{value:.12g}") for key, value in figures.items() if value},
    }
    own["stages"] = stages
    return rig_from_dict(own).effective()


def _truth(scenario: Scenario, simulation: Simulation) -> dict[str, Any]:
    profile = scenario.profile
    return {
        "profile": profile.name,
        "seed": scenario.seed,
        "gyro": {
            **_matrix("Kg", profile.gyro),
            "bias_dph": profile.gyro.bias / units.DEG_PER_HOUR,
            "noise": profile.gyro.noise,
            **_effects(profile.gyro),
        },
        "accel": {
            **_matrix("Ka", profile.accel),
            "bias_mps2": profile.accel.bias,
            "noise": profile.accel.noise,
            **_effects(profile.accel),
        },
        **_environment(scenario),
        "noise_units": "SI: rad/s and m/s^2 with s, the coefficients of IEEE Std 952",
        "lever_arm_m": scenario.rig.lever_arm_s,
        "schedule": [
            {
                "duration_s": piece.duration,
                "rate_dps": piece.rate / units.DEG,
                "slope_dps2": piece.slope / units.DEG,
                "sweep_dps": piece.sweep / units.DEG,
                "period_s": piece.period,
            }
            for piece in simulation.schedule.steps
        ],
    }


def _effects(triad: Triad) -> dict[str, Any]:
    """Return filter, line and repeated samples of a triad, SI, if it has any."""
    return {} if triad.effects == NO_EFFECTS else {"effects": asdict(triad.effects)}


def _environment(scenario: Scenario) -> dict[str, Any]:
    """Return temperature, nonlinearity and warm-up of a scenario, if any."""
    around = scenario.environment
    if around is None:
        return {}
    curve = around.nonlinearity
    dph = units.DEG_PER_HOUR
    fields: dict[str, Any] = {
        "temperature": {
            "profile_s_degC": around.temperature,
            "thermometer_lag_s": around.thermometer_lag,
            "thermometer_step_degC": around.thermometer_step,
            "reference_degC": around.reference,
            "gyro_bias_dph_per_degC_n": around.gyro_bias / dph,
            "gyro_scale_ppm_per_degC_n": around.gyro_scale / units.PPM,
            "accel_bias_mps2_per_degC_n": around.accel_bias,
        },
        "warm_up": {"amplitude_dph": around.warm_up / dph, "time_s": around.warm_up_time},
    }
    if curve is not None:
        fields["nonlinearity"] = {
            "full_scale_dps": curve.full_scale / units.DEG,
            "quadratic_dph": curve.quadratic / dph,
            "cubic_dph": curve.cubic / dph,
            "asymmetry_dph": curve.asymmetry / dph,
            "knee_dph": curve.knee_height / dph,
            "knee_dps": curve.knee_rate / units.DEG,
        }
    return fields


def _matrix(letter: str, triad: Triad) -> dict[str, Any]:
    """Return scale factors and installation errors by the papers' names, ppm."""
    return {
        f"{letter}{row}_ppm" if row == column else f"{letter}{row}{column}_ppm": float(
            triad.matrix[i, j] / units.PPM
        )
        for i, row in enumerate("xyz")
        for j, column in enumerate("xyz")
    }


def _toml(rig: dict[str, Any]) -> str:
    return f"{MARKS[0].decode()}: see truth.json next to it.\n" + tomlkit.dumps(rig)
