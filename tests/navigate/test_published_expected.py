"""R16's published means next to their expectation, the pooled test, and table 7's bound."""

import math

import numpy as np
import pytest
from scipy.stats import combine_pvalues

from rotcli.files.published import set_up
from rotcli.models.expected.sources import AxisSource, window_mean_variance
from rotcli.models.mean_covariance import SlowNoise
from rotcli.navigate.campaign.published import (
    expected_means,
    fitting_factor,
    published_tables,
)
from rotcli.navigate.campaign.ratios import (
    mean_output_tables,
    pooled_p,
    ratio_tables,
    run_ratios,
)
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR
from tests.models.expected.runs import contrast

# IMU, mode, unit: mean, scatter, 2.5 and 97.5 % quantiles, P of the published value; from a
# separate prototype with draws of its own (scatter of a mean of 20,000 draws: below 0.7 %).
TABLE = {
    ("NAV440", "partial", "horizontal_m"): (398.0, 57.0, 290.0, 512.0, 0.995),
    ("NAV440", "partial", "horizontal_mps"): (3.98, 0.56, 2.91, 5.12, 0.945),
    ("NAV440", "full", "horizontal_m"): (263.0, 43.0, 184.0, 353.0, 0.125),
    ("NAV440", "full", "horizontal_mps"): (2.78, 0.44, 1.97, 3.70, 0.089),
    ("NAV440", "conventional", "horizontal_m"): (1629.0, 828.0, 334.0, 3493.0, 0.926),
    ("MTi-G", "partial", "horizontal_m"): (1848.0, 290.0, 1307.0, 2436.0, 0.134),
    ("MTi-G", "partial", "horizontal_mps"): (18.8, 2.9, 13.4, 24.7, 0.068),
    ("MTi-G", "full", "horizontal_m"): (1529.0, 247.0, 1071.0, 2037.0, 0.022),
    ("MTi-G", "full", "horizontal_mps"): (16.2, 2.5, 11.5, 21.4, 0.007),
    ("MTi-G", "conventional", "horizontal_m"): (3510.0, 1813.0, 682.0, 7618.0, 0.404),
}


def test_published_means_have_the_verified_expectation():
    found = {(o.imu, o.mode, o.name): o for imu in ("NAV440", "MTi-G") for o in expected_means(imu)}
    for key, (mean, sigma, low, high, below) in TABLE.items():
        one = found[key]
        assert one.mean == pytest.approx(mean, rel=0.012), key
        assert one.sigma == pytest.approx(sigma, rel=0.03), key
        assert one.low == pytest.approx(low, rel=0.04), key
        assert one.high == pytest.approx(high, rel=0.02), key
        assert one.below == pytest.approx(below, abs=0.012), key


def test_the_two_unusual_means_fit_other_figures():
    white = [
        3.0 * fitting_factor("MTi-G", "full", "white", name)
        for name in ("horizontal_m", "horizontal_mps")
    ]
    assert white == pytest.approx([2.05, 1.9], rel=0.02)
    column = 1360.0 * fitting_factor("NAV440", "partial", "column", "horizontal_m")
    assert column == pytest.approx(2300.0, rel=0.03)
    (table,) = published_tables(["NAV440", "MTi-G"])
    assert "MTi-G full is low" in table.note
    assert "NAV440 partial is high" in table.note
    assert len(table.rows) == 12


def test_the_pooled_p_value_is_fishers():
    for p in ([0.3, 0.7, 0.02], [1e-4, 0.9], [0.5] * 10):
        assert pooled_p(p) == pytest.approx(combine_pvalues(p, "fisher").pvalue, rel=1e-9)


def test_no_noise_figures_through_figure_6_put_the_mean_output_within_table_7():
    # Figure 6: 24 deg/h at 120 s. Whatever N, B and K go through it, one mean corrected output
    # has a sigma of 0.010 deg/s at least, and ten rates within 0.011 and 0.025 deg/s a chance of
    # one in a thousand: the random walk of 2.6 deg/h/sqrt(s) is not what breaks the bound.
    w, bounds = 50.0 * DEG, set_up()
    for white in (2.0, 2.5, 3.0):
        for walk in (0.0, 1.0, 2.0, 2.6):
            rest = 24.0**2 - (white * 60.0) ** 2 / 120.0 - walk**2 * 120.0 / 3.0
            flicker = math.sqrt(rest) / 0.66428
            slow = SlowNoise(flicker * DEG_PER_HOUR, walk * DEG_PER_HOUR)
            source = AxisSource(white * DEG_PER_ROOT_HOUR, slow, contrast("full", w))
            sigma = math.sqrt(window_mean_variance(121.0, 421.0, w, source)) / DEG
            assert 0.0100 < sigma < 0.0111
            across = math.erf(bounds.across_dps / sigma / math.sqrt(2.0))
            along = math.erf(bounds.along_dps / sigma / math.sqrt(2.0))
            assert across ** (2 * bounds.rates) * along**bounds.rates < 2e-3


def _with_expected(documents, rate: float, ratio: float, p: float):
    doc = documents.navigation("B", "full", rate, 250.0 * ratio, 2.0)
    expected = {"rms": 250.0, "median": 210.0, "q999": 650.0, "p_value": p, "reason": None}
    mean = {axis: {"value": 0.001, "sigma": 0.0046, "unit": "deg/s"} for axis in "xyz"}
    return {**doc, "expected": {"horizontal_m": expected}, "mean_after": mean, "mean_p_value": 0.9}


def test_runs_are_pooled_per_device_and_mode(documents):
    docs = [
        _with_expected(documents, rate, ratio, p)
        for rate, ratio, p in ((10.0, 0.5, 0.8), (20.0, 1.0, 0.3), (30.0, 3.0, 1e-4))
    ]
    sources = documents.sources(*docs)
    found = run_ratios(sources)
    ratios = [doc["rms"]["horizontal_m"] / 250.0 for doc in docs]
    np.testing.assert_allclose([r.ratio for r in found], ratios)
    (table,) = ratio_tables(sources)
    row = table.rows[0]
    assert row[2] == 3
    assert row[7] == 1
    assert row[8] == pytest.approx(pooled_p([0.8, 0.3, 1e-4]))
    (means,) = mean_output_tables(sources)
    assert [r[1] for r in means.rows] == [10.0, 20.0, 30.0]


def test_the_mean_output_is_judged_by_the_published_bounds_of_table_7(documents):
    docs = []
    for imu, x, z in (("NAV440", 0.0109, 0.0249), ("NAV440", 0.0111, 0.0), ("my own", 0.02, 0.0)):
        doc = documents.navigation(imu, "full", 10.0 * (1 + len(docs)), 250.0, 2.0)
        values = {"x": x, "y": -0.001, "z": z}
        doc["mean_after"] = {a: {"value": v, "sigma": 0.0046} for a, v in values.items()}
        docs.append(doc)
    (table,) = mean_output_tables(documents.sources(*docs), published=True)
    assert [row[-1] for row in table.rows] == [None, "yes", "no"]
    assert table.rows[1][-3:-1] == (0.011, 0.025)
    (own,) = mean_output_tables(documents.sources(docs[2]), published=True)
    assert not [heading for heading in own.headings if "published" in heading or "bound" in heading]


def test_results_without_expected_errors_make_no_table(documents):
    sources = documents.sources(documents.navigation("B", "full", 10.0, 3.0, 4.0))
    assert ratio_tables(sources) == []
