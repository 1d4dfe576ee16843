"""Simulate a sequence on a multi-axis table with sensor errors and noise; write its files."""

from pathlib import Path
from typing import Any

import numpy as np

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.files.columns import write_columns
from rotcli.files.results.documents import document, write_error, write_result, write_text
from rotcli.files.simulation_folder import MARKS, lock_simulation_folder
from rotcli.lazy import lazily
from rotcli.models.earth import gravity_at
from rotcli.models.rotation import attitude_matrix
from rotcli.models.sensors import NoiseFigures, noise
from rotcli.models.triad import parameters as p
from rotcli.rig.profile import Profile
from rotcli.rig.rig import DEFAULT_SITE, Rig, rig_from_dict
from rotcli.rig.scenario import check_memory
from rotcli.rig.sequence import TableSequence
from rotcli.simulate.document import KIND
from rotcli.simulate.sequence import SequenceLog, SequenceSetup, simulate_sequence
from rotcli.units import FloatArray

with lazily():
    import tomlkit


TABLE_RATE = 50.0  # Hz
_COLUMNS = {1: ("angle",), 2: ("outer", "inner"), 3: ("outer", "middle", "inner")}


@dataclass(frozen=True, eq=False)
class SequenceScenario:
    """What is simulated: sequence, IMU profile, rig, errors (p,) SI, seed, encoder noise (rad)."""

    sequence: TableSequence
    profile: Profile
    rig: Rig
    errors: FloatArray
    seed: int
    encoder_noise: float


def typical_errors(mountings: int, seed: int) -> FloatArray:
    """Return errors (p,) drawn with their typical sizes; base azimuth and gravity from priors."""
    rng = np.random.default_rng([seed, 17])
    x = rng.standard_normal(p.count(mountings)) * p.typical_sizes(mountings)
    priors = p.default_priors(mountings)
    for k in (p.BASE_AZIMUTH, p.GRAVITY):
        x[k] = rng.standard_normal() * priors[k]
    return x


def errors_of_profile(profile: Profile, mountings: int) -> FloatArray:
    """Return the errors (p,) that a profile has: both matrices and biases."""
    x = np.zeros(p.count(mountings))
    x[p.N], x[p.GYRO_BIAS] = profile.gyro.matrix.ravel(), profile.gyro.bias
    x[p.M], x[p.ACCEL_BIAS] = profile.accel.matrix.ravel(), profile.accel.bias
    return x


def run_sequence(scenario: SequenceScenario) -> SequenceLog:
    """Return the logs of a scenario: exact motion, sensor errors, noise of the profile.

    Raises RigError if the memory of this machine is too small.
    """
    rig, sequence = scenario.rig, scenario.sequence
    site = rig.site or DEFAULT_SITE
    attitude = rig.attitude
    setup = SequenceSetup(
        axes=sequence.axes,
        C_nb=attitude_matrix(attitude.pitch or 0.0, attitude.roll or 0.0, attitude.azimuth or 0.0),
        mountings=sequence.mountings,
        latitude=site.latitude,
        gravity=gravity_at(site.latitude, site.height, site.gravity),
    )
    motion, rate = sequence.motion(), scenario.profile.rate
    check_memory(motion.duration, rate)
    sampling = "instant" if rig.imu.sampling == "instant" else "average"
    log = simulate_sequence(
        setup,
        motion,
        scenario.errors,
        rate=rate,
        table_rate=TABLE_RATE,
        sampling=sampling,
    )
    streams = np.random.default_rng(scenario.seed).spawn(7)
    for values, triad, first in ((log.gyro, scenario.profile.gyro, 0),
                                 (log.accel, scenario.profile.accel, 3)):  # fmt: skip
        figures = NoiseFigures(**triad.noise)
        for k in range(3):
            values[:, k] += noise(streams[first + k], len(values), 1.0 / rate, figures)
        if triad.range is not None:
            np.clip(values, -triad.range, triad.range, out=values)
        values[:] = triad.effects.apply(values, 1.0 / rate)
    log.angles[:] += scenario.encoder_noise * streams[6].standard_normal(log.angles.shape)
    return log


def write_sequence_run(
    folder: str, scenario: SequenceScenario, log: SequenceLog, suffix: str
) -> None:
    """Write imu and table logs, rig.toml and truth.json into a folder; raises ResultError."""
    place = Path(folder)
    logs = [place / f"imu.{suffix}", place / f"table.{suffix}"]
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise write_error(folder, fault) from fault
    rig = _rig(scenario, log)
    with lock_simulation_folder(place, [*logs, place / "rig.toml"]):
        write_text(str(place / "rig.toml"), _toml(rig))
        write_columns(logs[0], _imu_columns(scenario, log))
        write_columns(logs[1], _table_columns(scenario, log))
        write_result(str(place / "truth.json"), document(KIND, [], rig, _truth(scenario, log)))


def _imu_columns(scenario: SequenceScenario, log: SequenceLog) -> dict[str, Any]:
    increments = scenario.rig.imu.sampling == "increment"
    scale = 1.0 / scenario.profile.rate if increments else 1.0
    gyro, accel = ("rad", "m/s") if increments else ("rad/s", "m/s^2")
    columns: dict[str, Any] = {"time [s]": log.time}
    for name, unit, values in (("gyro", gyro, log.gyro), ("accel", accel, log.accel)):
        for k, axis in enumerate("xyz"):
            columns[f"{name}_{axis} [{unit}]"] = values[:, k] * scale
    return columns


def _table_columns(scenario: SequenceScenario, log: SequenceLog) -> dict[str, Any]:
    names = _COLUMNS[len(scenario.sequence.axes)]
    angles = (log.angles / units.DEG) % 360.0
    columns = {f"{name} [deg]": angles[:, k] for k, name in enumerate(names)}
    return {"time [s]": log.table_time, **columns}


def _rig(scenario: SequenceScenario, log: SequenceLog) -> dict[str, Any]:
    """Return the rig that describes the logs."""
    profile, site = scenario.profile, scenario.rig.site or DEFAULT_SITE
    own = scenario.rig.effective()
    figures = {
        "angle_random_walk": profile.gyro.noise.get("white", 0.0) / units.DEG_PER_ROOT_HOUR,
        "velocity_random_walk": profile.accel.noise.get("white", 0.0)
        / units.METRE_PER_SECOND_PER_ROOT_HOUR,
        "bias_instability": profile.gyro.noise.get("bias_instability", 0.0) / units.DEG_PER_HOUR,
        "rate_random_walk": profile.gyro.noise.get("rate_random_walk", 0.0) / units.DEG_PER_HOUR,
        "accel_bias_instability": profile.accel.noise.get("bias_instability", 0.0),
    }
    own["site"] = {
        "latitude": float(np.round(site.latitude / units.DEG, 12)),
        "longitude": float(np.round(site.longitude / units.DEG, 12)),
        "height": site.height,
        **({} if site.gravity is None else {"gravity": site.gravity}),
    }
    own["attitude"] = {"pitch": 0.0, "roll": 0.0, "azimuth": 0.0, **own.get("attitude", {})}
    own["imu"] = {
        **own.get("imu", {}),
        "name": profile.name,
        **{key: float(f"{value:.12g}") for key, value in figures.items() if value},
    }
    own["table"] = {"axes": scenario.sequence.axes.tolist()}
    if len(scenario.sequence.mountings) > 1:
        own["mountings"] = _mountings(scenario, log)
    return rig_from_dict(own).effective()


def _mountings(scenario: SequenceScenario, log: SequenceLog) -> list[dict[str, Any]]:
    """Return when the IMU was mounted how."""
    found = []
    for m, C_ms in enumerate(scenario.sequence.mountings):
        at = np.flatnonzero(log.mounting == m)
        if len(at):
            first, last = float(log.time[at[0]]), float(log.time[at[-1]])
            found.append({"from": first, "to": last, "mount": C_ms.T.tolist()})
    found[0]["sigma"] = 0.0
    return found


def _truth(scenario: SequenceScenario, log: SequenceLog) -> dict[str, Any]:
    count = len(scenario.sequence.mountings)
    rows = zip(
        p.names(count), scenario.errors, p.unit_factors(count), p.unit_names(count), strict=True
    )
    return {
        "profile": scenario.profile.name,
        "seed": scenario.seed,
        "sequence": scenario.sequence.name,
        "duration_s": float(log.time[-1]),
        "errors": {n: {"value": x / to_si, "unit": unit} for n, x, to_si, unit in rows},
    }


def _toml(rig: dict[str, Any]) -> str:
    return f"{MARKS[0].decode()}: see truth.json next to it.\n" + tomlkit.dumps(rig)
