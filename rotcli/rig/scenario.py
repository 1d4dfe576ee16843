"""Scenarios: what a simulation plays, from a TOML file or put together by a command.

A scenario file contains the sections of a rig (`[site]`, `[attitude]`, `[imu]`, `[table]`), and

    profile = "mti-g"        # an installed IMU profile, or a profile file beside this one
    seed = 1
    ramp = 1.0               # s, from one leg's rate to the next one's
    encoder_step = 1e-5      # deg, resolution of the table's angle

    [[leg]]                  # as many as wanted, one after another
    duration = 60            # s
    rate = 0.0               # deg/s
    stage = "static"         # static, rotation or navigation: named so in the rig it writes

    [[leg]]
    duration = 300
    sweep = 100.0            # deg/s: rate + sweep sin(2 pi t / period)
    period = 10.0            # s
"""

from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from rotcli.errors import RigError
from rotcli.files.text import parse_toml, read_text
from rotcli.files.toml_schema import check_keys, check_number, check_seed
from rotcli.models.laboratory.environment import Environment
from rotcli.rig.environment import read_environment
from rotcli.rig.profile import Profile, read_profile
from rotcli.rig.rig import DEFAULT_SITE, Attitude, Rig, Site, rig_from_dict
from rotcli.units import DEG

# Position accuracy of the papers' table (R16 section 4).
ENCODER_STEP = 1e-5 * DEG

STAGES = ("static", "rotation", "navigation")
_LEG_KEYS = ("duration", "rate", "sweep", "period", "stage")
_KEYS = ("profile", "seed", "ramp", "encoder_step", "leg")


@dataclass(frozen=True)
class Leg:
    """One leg of a scenario: a motion for a time, and its stage, if any.

    duration: s; rate, sweep: rad/s; period: s. The rate is `rate + sweep sin(2 pi t / period)`.
    """

    duration: float
    rate: float = 0.0
    sweep: float = 0.0
    period: float = 10.0
    stage: str | None = None


@dataclass(frozen=True, eq=False)
class Scenario:
    """Everything that determines a simulated log, SI and radians.

    rig: site, attitude, table axis, lever arm and sampling; what it leaves out is the papers'
    laboratory and a level table facing north. ramp: s, between legs of different rate.
    encoder_step: rad, the table angle's resolution (0: none). environment: temperature,
    nonlinearity and warm-up, if any.
    """

    profile: Profile
    legs: tuple[Leg, ...]
    rig: Rig = field(default_factory=Rig)
    ramp: float = 1.0
    encoder_step: float = ENCODER_STEP
    seed: int = 0
    environment: Environment | None = None

    @property
    def site(self) -> Site:
        """The rig's site, or the papers' laboratory."""
        return self.rig.site or DEFAULT_SITE

    @property
    def attitude(self) -> tuple[float, float, float]:
        """Pitch, roll, azimuth of the base, rad; zero where the rig says nothing."""
        given: Attitude = self.rig.attitude
        return given.pitch or 0.0, given.roll or 0.0, given.azimuth or 0.0


def read_scenario(path: str) -> Scenario:
    """Read a scenario file; raises RigError for what makes no sense."""
    try:
        data = parse_toml(read_text(_place(path)))
    except (OSError, UnicodeDecodeError) as fault:
        raise RigError(f"{path}: cannot be read: {fault}") from fault
    except ValueError as fault:
        raise RigError(f"{path}: not a TOML file: {fault}") from fault
    own = {key: data.pop(key) for key in _KEYS if key in data}
    environment = read_environment(path, data)
    if not isinstance(own.get("profile"), str):
        raise RigError(f"{path}: profile: missing; name an IMU profile such as mti-g")
    legs = own.get("leg")
    if not isinstance(legs, list) or not legs:
        raise RigError(f"{path}: leg: missing; give at least one [[leg]] with a duration")
    profile = own["profile"]
    beside = Path(path).with_name(profile)
    seed = check_seed(path, own.get("seed", 0))
    return Scenario(
        profile=read_profile(str(beside) if beside.is_file() else profile),
        legs=tuple(_leg(path, k, leg) for k, leg in enumerate(legs, start=1)),
        rig=rig_from_dict(data, path),
        ramp=check_number(path, "ramp", own.get("ramp", 1.0), positive=True),
        encoder_step=DEG
        * check_number(
            path, "encoder_step", own.get("encoder_step", ENCODER_STEP / DEG), positive=True
        ),
        seed=seed,
        environment=environment,
    )


def _place(path: str) -> Path:
    """Return the file of a scenario: that of the name, else the installed one."""
    if Path(path).exists() or not path.replace("-", "").isalnum():
        return Path(path)
    installed = resources.files("rotcli") / "data" / "scenarios" / f"{path}.toml"
    return Path(str(installed)) if installed.is_file() else Path(path)


def _leg(path: str, count: int, table: Any) -> Leg:
    place = f"[[leg]] {count} "
    check_keys(path, place, table, _LEG_KEYS)

    def value(key: str, default: float, *, positive: bool = False) -> float:
        return check_number(path, place + key, table.get(key, default), positive=positive)

    if "duration" not in table:
        raise RigError(f"{path}: {place}duration: missing; give it in s")
    duration = value("duration", 0.0, positive=True)
    stage = table.get("stage")
    if stage is not None and stage not in STAGES:
        raise RigError(f"{path}: {place}stage: {stage!r} is none of {', '.join(STAGES)}")
    period = value("period", 10.0, positive=True)
    if duration == 0.0 or period == 0.0:
        raise RigError(f"{path}: {place}duration and period must be above 0 s")
    return Leg(duration, DEG * value("rate", 0.0), DEG * value("sweep", 0.0), period, stage)
