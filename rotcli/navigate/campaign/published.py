"""R16's published RMS errors next to what the installed profiles let one expect.

Conventional is one run, partial and full are means of ten rates, each a run (R16 section 4.2).
The distribution of such a mean is that of draws of the quadratic forms: the runs are independent,
every device and its noise are the profile's. Means of RMS lie below the root of the mean square:
like is compared with like.
"""

from collections.abc import Sequence
from functools import cache
from typing import Literal

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.files.published import published, set_up
from rotcli.files.tables import Cell, Column, Table
from rotcli.models.earth import gravity_at
from rotcli.models.expected.errors import ExpectedErrors
from rotcli.models.expected.motion import StillTable
from rotcli.models.expected.plan import PlannedSensors, planned_errors
from rotcli.models.expected.statistics import expected_statistics
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.sensors import NoiseFigures
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import DEFAULT_SITE
from rotcli.units import DEG, DEG_PER_ROOT_HOUR, PPM, FloatArray

Mode = Literal["conventional", "partial", "full"]
MODES: tuple[Mode, ...] = ("conventional", "partial", "full")
NAMES = ("horizontal_m", "horizontal_mps")
PROFILES = {"NAV440": "nav440", "MTi-G": "mti-g"}
_ROW = {"horizontal_m": 9, "horizontal_mps": 10}
_PAIR = {"horizontal_m": (0, 1), "horizontal_mps": (3, 4)}
_DRAWS = 20_000  # sigma of a probability of 1 %: 0.07 %
_SEED = 16


@dataclass(frozen=True, eq=False)
class ExpectedMean:
    """Distribution of a published figure: mean and sigma, 2.5 and 97.5 % quantiles.

    published: the value in R16; below: the chance of a smaller one; m or m/s.
    """

    imu: str
    mode: Mode
    name: str
    mean: float
    sigma: float
    low: float
    high: float
    published: float
    below: float


@dataclass(frozen=True, eq=False)
class _Runs:
    """The runs of one IMU and mode: expected errors of each rate, draws (runs, draws) by name."""

    errors: tuple[ExpectedErrors, ...]
    draws: dict[str, FloatArray]


def _noise(figures: dict[str, float]) -> tuple[float, SlowNoise]:
    noise = NoiseFigures(**figures)
    return noise.white, SlowNoise.from_figures(noise)


@cache
def _runs(imu: str, mode: Mode) -> _Runs:
    """Return the runs of R16's campaign with an installed profile."""
    profile = read_profile(PROFILES[imu])
    site = DEFAULT_SITE
    gravity = gravity_at(site.latitude, site.height, site.gravity)
    table = StillTable(site.latitude, site.height, gravity)
    sensors = PlannedSensors(
        gyro=(_noise(profile.gyro.noise),),
        accel=(_noise(profile.accel.noise),),
        matrix=profile.gyro.matrix,
        accel_bias=profile.accel.bias,
    )
    count = 1 if mode == "conventional" else set_up().rates
    rates = 10.0 * DEG * np.arange(1, count + 1)
    errors = tuple(
        planned_errors(sensors, table, mode, float(rate), set_up().duration_s) for rate in rates
    )
    rng = np.random.default_rng([_SEED, MODES.index(mode)])
    draws: dict[str, list[FloatArray]] = {name: [] for name in NAMES}
    for one in errors:
        forms = expected_statistics(one).forms
        for name in NAMES:
            lam, delta2 = forms.lam[_ROW[name]], forms.delta2[_ROW[name]]
            keep = lam > 1e-3 * lam[lam > 0.0].max()  # 0.1 % of the mean square at most each
            normal = rng.standard_normal((_DRAWS, int(keep.sum())))
            form = (normal + np.sqrt(delta2[keep])) ** 2 @ lam[keep]
            form = form + float((lam * (1.0 + delta2))[~keep].sum())
            draws[name].append(np.sqrt(form))
    return _Runs(errors, {name: np.array(values) for name, values in draws.items()})


def expected_means(imu: str) -> list[ExpectedMean]:
    """Return the expected distribution of every published horizontal figure of an IMU.

    imu: a key of PROFILES.
    """
    paper = published(imu)
    found: list[ExpectedMean] = []
    if paper is None:
        return found
    for mode in MODES:
        runs = _runs(imu, mode)
        for name in NAMES:
            mean = runs.draws[name].mean(axis=0)
            value = paper.rms[mode][name]
            low, high = np.quantile(mean, (0.025, 0.975))
            found.append(
                ExpectedMean(
                    imu=imu,
                    mode=mode,
                    name=name,
                    mean=float(mean.mean()),
                    sigma=float(mean.std()),
                    low=float(low),
                    high=float(high),
                    published=value,
                    below=float(np.mean(mean < value)),
                )
            )
    return found


def fitting_factor(imu: str, mode: Mode, source: str, name: str) -> float:
    """Return the factor on one source with which the published mean would be the expected one.

    The mean square is linear in the source's part; the ratio of mean RMS and root of the mean
    square is taken from the draws. source: a key of `ExpectedErrors.parts`.
    """
    paper = published(imu)
    if paper is None:
        raise ValueError(f"nothing is published of {imu}")
    runs = _runs(imu, mode)
    rows = list(_PAIR[name])
    squares = np.array([one.mean_square[rows].sum() for one in runs.errors])
    parts = np.array([one.parts[source][rows].sum() for one in runs.errors])
    ratio = runs.draws[name].mean(axis=1) / np.sqrt(squares)
    low, high = 0.0, 10.0
    for _ in range(40):
        factor = 0.5 * (low + high)
        mean = float(np.mean(ratio * np.sqrt(squares + (factor**2 - 1.0) * parts)))
        low, high = (factor, high) if mean < paper.rms[mode][name] else (low, factor)
    return 0.5 * (low + high)


def published_tables(imus: Sequence[str]) -> list[Table]:
    """Return R16's means next to the expectation of the installed profiles, for known IMUs."""
    names = [name for name in PROFILES if any(_same(name, imu) for imu in imus)]
    if not names:
        return []
    rows: list[tuple[Cell, ...]] = []
    for imu in names:
        rows += [
            (
                imu,
                one.mode,
                "position, m" if one.name == "horizontal_m" else "velocity, m/s",
                one.mean,
                one.sigma,
                one.low,
                one.high,
                one.published,
                one.below,
            )
            for one in expected_means(imu)
        ]
    columns = (
        Column("IMU"),
        Column("mode"),
        Column("horizontal RMS"),
        Column("expected", ".4g"),
        Column("scatter", ".3g"),
        Column("2.5 %", ".4g"),
        Column("97.5 %", ".4g"),
        Column("published", ".4g"),
        Column("P", ".3f"),
    )
    note = (
        "Expected: mean and scatter of what R16 averages (one conventional run; ten rates of the "
        "others) for the installed profile. P: chance of a smaller value. " + _remarks(names)
    )
    return [Table("R16's means next to the expectation of the profiles", columns, rows, note)]


def _same(name: str, imu: str) -> bool:
    ours, theirs = published(name), published(imu)
    return ours is not None and theirs is not None and ours.source == theirs.source


def _remarks(names: Sequence[str]) -> str:
    """Return what would make the two most unlikely published means the expected ones."""
    remarks = []
    if "MTi-G" in names:
        white = _noise(read_profile(PROFILES["MTi-G"]).gyro.noise)[0] / DEG_PER_ROOT_HOUR
        fits = [white * fitting_factor("MTi-G", "full", "white", name) for name in NAMES]
        remarks.append(
            f"MTi-G full is low: it fits a white noise of {min(fits):.2f} to {max(fits):.2f} "
            f"deg/sqrt(h) rather than {white:.1f}."
        )
    if "NAV440" in names:
        column = read_profile(PROFILES["NAV440"]).gyro.matrix[:2, 2]
        size = float(np.hypot(*column)) / PPM
        fit = size * fitting_factor("NAV440", "partial", "column", "horizontal_m")
        remarks.append(
            f"NAV440 partial is high: it fits installation errors |Kgxz, Kgyz| of {fit:.0f} ppm "
            f"instead of the profile's {size:.0f}."
        )
    return " ".join(remarks)
