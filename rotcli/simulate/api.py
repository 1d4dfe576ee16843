"""Simulate one run on a still or turning table: a scenario in, logs with true values out."""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.toml_schema import check_number
from rotcli.rig.profile import read_profile
from rotcli.rig.scenario import LEG_KEYS, SCENARIO_KEYS, Leg, Scenario, check_memory, read_scenario
from rotcli.simulate.document import write_simulation
from rotcli.simulate.estimate import Simulation, simulate
from rotcli.units import DEG

if TYPE_CHECKING:
    from rotcli.logs.record import Progress
    from rotcli.rig.rig import Rig


@dataclass(frozen=True)
class SimulateOptions:
    """Settings of a simulated run: a still segment, a turning one, and the navigation window.

    imu: name or file of a profile; rate: table rate, deg/s; static, rotation, navigation, ramp:
    s; encoder_step: deg. None: the default of the scenario.
    """

    imu: str
    rate: float
    static: float = 60.0
    rotation: float = 60.0
    navigation: float = 300.0
    ramp: float | None = None
    encoder_step: float | None = None
    seed: int | None = None


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """Simulated logs in memory, with their scenario."""

    scenario: Scenario
    simulation: Simulation

    @property
    def warnings(self) -> list[str]:
        """Warn of readings that the range of the gyros clips."""
        profile = self.scenario.profile
        limit = profile.gyro.range
        if limit is None:
            return []
        count = int((abs(self.simulation.imu.gyro) >= limit).any(axis=1).sum())
        shown = f"{profile.name}, {limit / DEG:.6g} deg/s"
        return [f"{count} samples are clipped at the gyro range of {shown}"] if count else []

    def write(self, folder: str, suffix: Literal["parquet", "csv"] = "parquet") -> None:
        """Write imu and table logs, rig.toml and truth.json into a folder; raises ResultError."""
        write_simulation(folder, self.scenario, self.simulation, suffix)


def scenario_from_options(options: SimulateOptions, rig: "Rig") -> Scenario:
    """Return the scenario of R16: still, turning, and navigation at the same rate.

    Raises RigError if no segment has a duration, and for a value out of range.
    """
    duration = replace(LEG_KEYS["duration"], above=False)
    for stage in ("static", "rotation", "navigation"):
        check_number("simulate", stage, duration, getattr(options, stage))
    for name, key, value in (
        ("rate", LEG_KEYS["rate"], options.rate),
        ("ramp", SCENARIO_KEYS["ramp"], options.ramp),
        ("encoder_step", SCENARIO_KEYS["encoder_step"], options.encoder_step),
    ):
        if value is not None:
            check_number("simulate", name, key, value)
    durations = {
        "static": options.static,
        "rotation": options.rotation if options.rate else 0.0,
        "navigation": options.navigation,
    }
    legs = tuple(
        Leg(duration, 0.0 if stage == "static" else options.rate * DEG, stage=stage)
        for stage, duration in durations.items()
        if duration > 0.0
    )
    if not legs:
        raise RigError("static, rotation and navigation: the total duration is 0 s")
    scenario = Scenario(read_profile(options.imu), legs, rig=rig)
    step = None if options.encoder_step is None else options.encoder_step * DEG
    return change_scenario(scenario, ramp=options.ramp, seed=options.seed, encoder_step=step)


def change_scenario(scenario: Scenario, **changes: float | None) -> Scenario:
    """Return the scenario with the values that are not None in place of its own."""
    given = {key: value for key, value in changes.items() if value is not None}
    return replace(scenario, **given)  # type: ignore[arg-type]


def scenario_from_file(path: str, imu: str | None = None) -> Scenario:
    """Return the scenario of a file, with another IMU profile if one is given."""
    scenario = read_scenario(path)
    return scenario if imu is None else replace(scenario, profile=read_profile(imu))


def simulate_run(scenario: Scenario, progress: "Progress | None" = None) -> SimulatedRun:
    """Simulate the logs of a scenario; the same scenario and seed give the same logs.

    Raises RigError if the memory of this machine is too small.
    """
    check_memory(sum(leg.duration for leg in scenario.legs), scenario.profile.rate)
    return SimulatedRun(scenario, simulate(scenario, progress=progress))
