"""R16, "MEMS IMU Error Mitigation Using Rotation Modulation Technique", Sensors 2016, 16, 2017."""

import math
import tomllib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np

from rotcli.budget.calibration_time import calibration_sigmas
from rotcli.budget.estimate import GYRO_BIAS, budget, one_turn
from rotcli.files.published import Published, published, set_up
from rotcli.files.results.documents import read_result
from rotcli.files.results.groups import Group, Source, grouped, mean
from rotcli.models.base import FixedBase
from rotcli.models.earth import gravity_at
from rotcli.models.sensors import NoiseFigures, TriadErrors
from rotcli.navigate.campaign.errors import level_tables
from rotcli.navigate.campaign.ratios import mean_output, within_published_bound
from rotcli.navigate.campaign.tables import navigation_runs
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import DEFAULT_SITE
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, PPM
from tests.campaigns.papers.item import (
    AGREES,
    CONTRADICTED,
    CORRECTED,
    DIFFERS,
    IN_KIND,
    INCOMPATIBLE,
    Item,
    agreement,
    likeness,
)

IMUS = {"mti-g": "MTi-G", "nav440": "NAV440"}
FACTOR = 2.5  # of horizontal means: simulated devices replace recorded ones
_TURNS = 1e-6  # relative, of formula and integral
_DIGITS = 0.01  # relative: one unit of the last printed digit
_TWICE = 0.16  # ppm: what rounding twice to one digit can make
_ALLAN = 0.15  # relative: two hours know a deviation near 120 s to 6 %, and its minimum varies
_LINEAR = 0.95  # correlation of the azimuth error with the rate
_ORDER = 5.0  # "nearly an order of magnitude"


def formula_items() -> list[Item]:
    """Return the items that follow from formulas and installed profiles."""
    items = [*_turn_items()]
    for name, imu in IMUS.items():
        items += [*_sensor_items(name, imu), *_noise_items(name, imu)]
    return items


def campaign_items(folder: Path) -> list[Item]:
    """Return the items of the campaign of `make`; folder: campaign/."""
    items: list[Item] = []
    for name, imu in IMUS.items():
        paper = published(imu)
        assert paper is not None
        sources = [
            Source(str(path), read_result(str(path)))
            for path in sorted((folder / name).glob("*/*.json"))
            if path.stem in ("conventional", "partial", "full")
        ]
        runs = navigation_runs(sources)
        groups = grouped(runs)
        items += _conventional_items(imu, paper, groups)
        items += _rate_items(imu, paper, groups)
        items += _mean_output_items(imu, sources)
        items.append(_allan_item(name, imu, folder))
    return items


def _base() -> FixedBase:
    site = DEFAULT_SITE
    return FixedBase(site.latitude, gravity_at(site.latitude, site.height, site.gravity), np.eye(3))


def _turn_items() -> list[Item]:
    """Table 1, and the velocity of a gyro bias after one turn (section 2.2)."""
    worst = 0.0
    for name in IMUS:
        profile = read_profile(name)
        gyro = TriadErrors(profile.gyro.matrix, profile.gyro.bias)
        noise = NoiseFigures(**profile.gyro.noise)
        found = budget(gyro, profile.accel.bias, noise, _base(), rate=10.0 * DEG)
        for turn in found.turns:
            size = np.abs(turn.closed_form).max()
            worst = max(worst, float(np.abs(turn.integrated - turn.closed_form).max() / size))
    bias = np.array([120.0, 0.0, 0.0]) * DEG_PER_HOUR
    turn = one_turn("z", GYRO_BIAS, bias, np.zeros((3, 3)), _base(), 10.0 * DEG)
    assert turn.navigated is not None
    left = float(np.hypot(*turn.navigated.velocity[:2]))
    return [
        Item(
            "R16 table 1",
            "formula against integral, both IMUs",
            f"differ by {worst:.0e}" if worst > 1e-12 else "differ by less than 1e-12",
            "formula",
            AGREES if worst < _TURNS else DIFFERS,
        ),
        Item(
            "R16 (10) to (25)",
            "velocity after one turn, 120 deg/h across z, 10 deg/s",
            f"{left:.2f} m/s",
            "cancels",
            CONTRADICTED if left > 0.1 else AGREES,
        ),
    ]


def _sensor_items(name: str, imu: str) -> list[Item]:
    """Tables 2 and 3."""
    data = files("rotcli").joinpath("data/published_r16.toml").read_text("utf-8")
    paper = tomllib.loads(data)["imu"][imu]["sensors"]
    profile = read_profile(name)
    walk = profile.gyro.noise["white"] / DEG_PER_ROOT_HOUR
    span = float(np.max(profile.gyro.range)) / DEG if profile.gyro.range is not None else 0.0
    return [
        Item(
            "R16 table 2", f"{imu}: gyro range, deg/s", f"{span:.0f}", f"{paper['range_dps']:.0f}",
            agreement(span, paper["range_dps"], _DIGITS),
        ),
        Item(
            "R16 table 3", f"{imu}: angle random walk, deg/sqrt(h)", f"{walk:.1f}",
            f"{paper['angle_random_walk']:.1f}",
            agreement(walk, paper["angle_random_walk"], _DIGITS),
        ),
    ]  # fmt: skip


def _noise_items(name: str, imu: str) -> list[Item]:
    """Table 6: sigmas of a calibration under white noise."""
    paper = published(imu)
    assert paper is not None
    noise = NoiseFigures(**read_profile(name).gyro.noise)
    rows = {rate: calibration_sigmas(noise, 60.0, rate * DEG) for rate in paper.scale_ppm}
    bias = next(iter(rows.values())).bias_white / DEG_PER_HOUR
    scale = {rate: row.column_white / PPM for rate, row in rows.items()}
    first, last = min(scale), max(scale)
    others = [r for r, value in paper.scale_ppm.items() if f"{scale[r]:.1f}" != f"{value:.1f}"]
    rounded = [
        Item(
            "R16 table 6", f"{imu}: the same at {rate:g} deg/s, ppm", f"{scale[rate]:.2f}",
            f"{paper.scale_ppm[rate]:.1f} (rounded twice)",
            CORRECTED if abs(scale[rate] - paper.scale_ppm[rate]) < _TWICE else DIFFERS,
        )
        for rate in others
    ]  # fmt: skip
    return [
        Item(
            "R16 table 6", f"{imu}: sigma of a bias, deg/h", f"{bias:.1f}", f"{paper.bias_dph:.1f}",
            agreement(bias, paper.bias_dph, _DIGITS),
        ),
        Item(
            "R16 table 6", f"{imu}: sigma of a scale factor at {first:g} to {last:g} deg/s, ppm",
            f"{scale[first]:.1f} to {scale[last]:.1f}",
            f"{paper.scale_ppm[first]:.1f} to {paper.scale_ppm[last]:.1f}",
            AGREES if len(others) < 2 else DIFFERS,
        ),
        *rounded,
    ]  # fmt: skip


def _mean(groups: Sequence[Group], mode: str, name: str) -> float:
    """Return the mean over the rates of a mode."""
    value = mean([group.mean(name) for group in groups if group.mode == mode])
    assert value is not None, f"no {mode} runs"
    return value


def _conventional_items(imu: str, paper: Published, groups: Sequence[Group]) -> list[Item]:
    """Tables 4 and 5: one published run; ours is the mean of ten."""
    item = paper.source
    items = []
    for name, unit, label in (
        ("horizontal_m", "m", "horizontal position"),
        ("horizontal_mps", "m/s", "horizontal velocity"),
        ("height_m", "m", "height"),
        ("azimuth_deg", "deg", "azimuth"),
    ):
        ours, value = _mean(groups, "conventional", name), paper.rms["conventional"][name]
        verdict = likeness(ours, value, FACTOR)
        what = f"{imu} conventional: {label}, {unit}"
        items.append(Item(item, what, f"{ours:.4g}", f"{value:.4g}", verdict))
    return items


def _rate_items(imu: str, paper: Published, groups: Sequence[Group]) -> list[Item]:
    """Figures 7 to 12 and section 4.2: means over the rates, order of modes, attitude."""
    item = "R16 figures 7 to 12"
    items = []
    for mode in ("partial", "full"):
        for name, unit, label in (
            ("horizontal_m", "m", "position"),
            ("horizontal_mps", "m/s", "velocity"),
        ):
            ours, value = _mean(groups, mode, name), paper.rms[mode][name]
            what = f"{imu} {mode}: horizontal {label}, mean of ten rates, {unit}"
            verdict = likeness(ours, value, FACTOR)
            items.append(Item(item, what, f"{ours:.4g}", f"{value:.4g}", verdict))
    ratios = [
        side["partial"] / side["full"]
        for side in (
            {mode: _mean(groups, mode, "horizontal_m") for mode in ("partial", "full")},
            {mode: paper.rms[mode]["horizontal_m"] for mode in ("partial", "full")},
        )
    ]
    what = f"{imu}: partial / full, horizontal position"
    verdict = IN_KIND if 1.05 <= ratios[0] <= 4.0 else DIFFERS
    items.append(Item(item, what, f"{ratios[0]:.2f}", f"{ratios[1]:.2f}", verdict))
    members = [group for group in groups if group.mode == "partial"]
    azimuth = [group.mean("azimuth_deg") for group in members]
    correlation = float(np.corrcoef([group.rate for group in members], np.array(azimuth))[0, 1])
    items.append(
        Item(
            item, f"{imu} partial: azimuth grows with the rate", f"correlation {correlation:.3f}",
            "in proportion", AGREES if correlation > _LINEAR else DIFFERS,
        )
    )  # fmt: skip
    (table,) = level_tables([group for group in groups if group.mode == "full"])
    cells = dict(zip(table.headings, table.rows[0], strict=True))
    factor, expected = (float(cells.get(k) or 0.0) for k in ("azimuth / level", "expected"))
    verdict = IN_KIND if factor >= _ORDER else DIFFERS
    what = f"{imu} full: roll and pitch below azimuth"
    ours = f"{factor:.1f} times ({expected:.1f} expected)"
    return [*items, Item(item, what, ours, "nearly an order", verdict)]


def _mean_output_items(imu: str, sources: Sequence[Source]) -> list[Item]:
    """Table 7: the mean corrected output over the navigation, and its chance under the noise."""
    full = [source for source in sources if source.doc["mode"] == "full"]
    values = np.array([mean_output(source) for source in full])
    bounds = set_up()
    inside = all(within_published_bound(row, bounds.axis) for row in values.tolist())
    across, along = np.abs(values[:, :2]).max(), np.abs(values[:, 2]).max()
    chance = 1.0
    for source in full:
        sigma = [source.number("mean_after", axis, "sigma") for axis in "xyz"]
        limits = (bounds.across_dps, bounds.across_dps, bounds.along_dps)
        for s, limit in zip(sigma, limits, strict=True):
            chance *= math.erf(limit / s / math.sqrt(2.0))
    return [
        Item(
            "R16 table 7",
            f"{imu}: largest mean output across, along z, deg/s",
            f"{across:.4f}, {along:.4f} (chance to be within: {chance:.2g})",
            f"{bounds.across_dps:g}, {bounds.along_dps:g}",
            AGREES if inside else INCOMPATIBLE if chance < 0.01 else DIFFERS,
        )
    ]


def _allan_item(name: str, imu: str, folder: Path) -> Item:
    """Figure 6: the Allan deviation of gyro x near 120 s."""
    data = files("rotcli").joinpath("data/published_r16.toml").read_text("utf-8")
    paper = tomllib.loads(data)["imu"][imu]["sensors"]
    entry = read_result(str(folder / name / "hours" / "allan.json"))["axes"]["gyro_x"]
    tau, deviation = np.array(entry["tau_s"]), np.array(entry["deviation"])
    ours = float(np.exp(np.interp(np.log(paper["allan_s"]), np.log(tau), np.log(deviation))))
    return Item(
        "R16 figure 6",
        f"{imu}: Allan deviation of gyro x at {paper['allan_s']:g} s, deg/h",
        f"{ours:.1f}",
        f"{paper['allan_dph']:g}",
        agreement(ours, paper["allan_dph"], _ALLAN),
    )
