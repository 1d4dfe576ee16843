"""The page of what happens to a calibration that ignores one error of table or sensors.

Run as `python -m tests.triad.ignored_errors` it writes docs/explanation/ignored-errors.md. Each row
is deterministic: exact block means of sequence S1 with one error, estimated without its parameter.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.models.triad.blocks import expected_means
from rotcli.triad.estimate import estimate
from tests.triad import bench

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "ignored-errors.md"
# Error, its parameters and values (in the units of results).
CASES = (
    ("base tilt 60 arcsec", {"base_tilt_east": 60.0, "base_tilt_north": 60.0}),
    ("outer and middle axis 20 arcsec from square", {"outer_middle": 20.0}),
    ("middle and inner axis 20 arcsec from square", {"middle_inner": 20.0}),
    ("zero of the middle encoder 20 arcsec", {"middle_zero": 20.0}),
    ("clock of the accelerometers 1 ms", {"clock_accel": 1000.0}),
    ("clock of the gyros 1 ms", {"clock_gyro": 1000.0}),
    ("second-order terms 100 ug/g^2", dict.fromkeys(p.GROUPS["K2"].names, 100.0)),
    ("levers 50 mm", {"lever_x_x": 50.0, "lever_y_y": 50.0, "lever_z_z": 50.0}),
    ("gravity 50 mGal", {"gravity": 5e-4}),
    ("gyro asymmetry 100 ppm", dict.fromkeys(p.GROUPS["Ag"].names, 100.0)),
    ("accelerometer asymmetry 100 ppm", dict.fromkeys(p.GROUPS["Aa"].names, 100.0)),
    ("g-sensitivity 20 deg/h/g", dict.fromkeys(p.GROUPS["G"].names, 20.0)),
    ("azimuth of the base 0.5 deg", {"base_azimuth": 1800.0}),
)
_GROUPS_IGNORED = {"lever_x_x": p.LEVERS}  # with one lever all nine are left out
_WORST = 3  # parameters named in a row
_NEGLIGIBLE = 0.6  # sigma
_NO_EXCESS = 1e-6  # of chi-squared per reading


@cache
def _set_up():
    return bench.problem(bench.three_axes()), bench.blocks(sequences.s1())


@cache
def shifts(label):
    """Return shifts of the other parameters (p,), SI, in sigmas (p,), and the excess chi2 per row.

    label: of CASES. Sigmas are those that the incomplete calibration would print. The chi-squared
    is that of blocks of this program (15 deg, 10 s).
    """
    errors = dict(CASES)[label]
    problem, blocks = _set_up()
    x = np.zeros(p.count())
    factors = p.unit_factors()
    ignored = {p.INDEX[name] for name in errors}
    for name, value in errors.items():
        x[p.INDEX[name]] = value * factors[p.INDEX[name]]
        extra = _GROUPS_IGNORED.get(name)
        ignored |= set(range(extra.start, extra.stop)) if extra else set()
    data = replace(blocks, means=expected_means(problem.table, x, blocks))
    # Gravity and azimuth are known from priors anyway: ignoring them fixes them at zero.
    free = np.array([k for k in problem.free if k not in ignored])
    fit = estimate(replace(problem, free=free), data)
    shift = fit.x.copy()
    shift[list(ignored)] = 0.0
    sigma = fit.sigma / fit.scale
    in_sigma = np.divide(shift, sigma, out=np.zeros_like(shift), where=sigma > 0.0)
    left = fit.residuals / problem.sigma_1[:, None]
    excess = float(np.mean(blocks.count * left**2))
    return shift, in_sigma, excess


def _row(label):
    shift, in_sigma, excess = shifts(label)
    factors, units = p.unit_factors(), p.unit_names()
    order = np.argsort(-np.abs(in_sigma))[:_WORST]
    worst = [
        f"{p.NAMES[k]} {shift[k] / factors[k]:.2g} {units[k]} ({abs(in_sigma[k]):.2g} sigma)"
        for k in order if abs(in_sigma[k]) > _NEGLIGIBLE
    ]  # fmt: skip
    largest = f"nothing above {_NEGLIGIBLE:g} sigma" if not worst else ", ".join(worst)
    return f"| {label} | {largest} | {excess if excess > _NO_EXCESS else 0:.1g} |"


def page():
    """Return the page as Markdown."""
    rows = "\n".join(_row(label) for label, _ in CASES)
    return f"""# What an ignored error does to a calibration

Made by `python -m tests.triad.ignored_errors`; a test creates it again. Sequence S1 (41 min, three
axes), 0.4 deg/sqrt(h), 0.05 m/s/sqrt(h), every other parameter estimated.

| ignored | shifts the others | adds to chi-squared per reading |
| --- | --- | --- |
{rows}

Errors of the table of 20 arcsec do not show in the residuals, but shift the result by 15 to 33
sigma: they must be parameters. Chi-squared finds clocks, levers and base tilt only. A wrong gravity
never shows: it is a common factor of all accelerometer scale factors. `rotcli triad` estimates all
of these; the asymmetries with `--asymmetry`.
"""


def main():
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
