"""Scenarios: what a simulation plays, from a TOML file or put together by a command.

A scenario file contains the sections of a rig (`[site]`, `[attitude]`, `[imu]`, `[table]`), and

    profile = "mti-g"        # an installed IMU profile, or a profile file next to this one
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

import os
from dataclasses import field
from pathlib import Path
from typing import Any

from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.installed import DATA
from rotcli.files.text import parse_toml, read_text
from rotcli.files.toml_schema import Key, check_keys, check_number, check_seed, parse_value, show
from rotcli.models.laboratory.environment import Environment
from rotcli.rig.environment import read_environment
from rotcli.rig.profile import Profile, installed_profiles, read_profile
from rotcli.rig.rig import DEFAULT_SITE, Attitude, Rig, Site, rig_from_dict
from rotcli.units import DEG

# Position accuracy of the papers' table (R16 section 4).
ENCODER_STEP = 1e-5 * DEG

STAGES = ("static", "rotation", "navigation")
_MAX_TIME = 1e7  # s, 115 days
_RATE = Key("number", "deg/s", DEG, -36000.0, 36000.0)  # 100 turns a second
LEG_KEYS = {
    "duration": Key("number", "s", low=0.0, high=_MAX_TIME, above=True),
    "rate": _RATE,
    "sweep": _RATE,
    "period": Key("number", "s", low=1e-3, high=_MAX_TIME),
    "stage": Key("choice", choices=STAGES),
}
SCENARIO_KEYS = {
    "profile": Key("text"),
    "seed": Key("count"),
    "ramp": Key("number", "s", low=0.0, high=1e5),
    "encoder_step": Key("number", "deg", DEG, 0.0, 360.0),
    "leg": Key("table"),
}
_BYTES_PER_SAMPLE = 600  # of memory in a simulation, measured 350 to 520


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
        text = getattr(fault, "strerror", None) or fault
        raise RigError(f"{path}: cannot be read: {text}") from fault
    except ValueError as fault:
        raise RigError(f"{path}: not a TOML file: {fault}") from fault
    own = {key: data.pop(key) for key in SCENARIO_KEYS if key in data}
    environment = read_environment(path, data)
    if not isinstance(own.get("profile"), str):
        raise RigError(f"{path}: profile: missing; name an IMU profile such as mti-g")
    legs = own.get("leg")
    if not isinstance(legs, list) or not legs:
        raise RigError(f"{path}: leg: missing; give at least one [[leg]] with a duration")
    seed = check_seed(path, own.get("seed", 0))

    def number(key: str, default: float) -> float:
        return check_number(path, key, SCENARIO_KEYS[key], own.get(key, default))

    scenario = Scenario(
        profile=read_profile(_profile_next_to(path, own["profile"])),
        legs=tuple(_leg(path, k, leg) for k, leg in enumerate(legs, start=1)),
        rig=rig_from_dict(data, path),
        ramp=number("ramp", 1.0),
        encoder_step=number("encoder_step", ENCODER_STEP / DEG),
        seed=seed,
        environment=environment,
    )
    for count, leg in enumerate(scenario.legs, start=1):
        if leg.duration * scenario.profile.rate < 1.0:
            text = f"{leg.duration:g} s is shorter than one sample; make it longer"
            raise RigError(f"{path}: [[leg]] {count} duration: {text}")
    return scenario


def check_memory(duration: float, rate: float) -> None:
    """Raise RigError for a simulation (s, Hz) that does not fit into the memory of this machine."""
    needed = duration * rate * _BYTES_PER_SAMPLE
    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > available:
        raise RigError(
            f"{duration:g} s at {rate:g} Hz need about {needed / 1e9:.3g} GB of "
            f"memory, this machine has {available / 1e9:.3g} GB; simulate a shorter log"
        )


def _profile_next_to(path: str, profile: str) -> str:
    """Return the profile file next to a scenario, else the name of an installed profile."""
    if profile in installed_profiles():
        return profile
    odd = profile in ("", ".", "..") or not profile.isprintable()
    if odd or Path(profile).name != profile:
        text = f"{show(profile)} is neither an installed profile nor a file name"
        raise RigError(f"{path}: profile: {text}; put the profile next to the scenario")
    return str(Path(path).with_name(profile))


def _place(path: str) -> Path:
    """Return the file of a scenario: that of the name, else the installed one."""
    if Path(path).exists() or not path.replace("-", "").isalnum():
        return Path(path)
    installed = DATA / "scenarios" / f"{path}.toml"
    return installed if installed.is_file() else Path(path)


def _leg(path: str, count: int, table: Any) -> Leg:
    place = f"[[leg]] {count} "
    check_keys(path, place, table, LEG_KEYS)

    def value(key: str, default: float) -> float:
        return check_number(path, place + key, LEG_KEYS[key], table.get(key, default))

    if "duration" not in table:
        raise RigError(f"{path}: {place}duration: missing; give it in s")
    stage = table.get("stage")
    if stage is not None:
        parse_value(path, place + "stage", LEG_KEYS["stage"], stage)
    return Leg(
        value("duration", 0.0),
        value("rate", 0.0),
        value("sweep", 0.0),
        value("period", 10.0),
        stage,
    )
