"""Fits of many simulated rate tests: scatter of the estimates, power of the selection."""

import numpy as np
import pytest

from rotcli.scale.figures import nonlinearity, scale_factor
from rotcli.scale.fit import CurveProblem, select_model
from tests.scale.sets import (
    A1,
    DPH,
    FULL_SCALE,
    IMUS,
    PPM,
    TRUTHS,
    noisy_blocks,
)

FS = FULL_SCALE


def campaign(imu, name, seeds, rates=A1):
    """Normalised errors, model choices and figures over simulated tests."""
    rng = np.random.default_rng(1952)
    figures = IMUS[imu]
    out = {"error": [], "refuted": [], "chosen": [], "nl": [], "nl_raw": []}
    fitted = {"line": "line", "knee": "table"}.get(name, name)
    for _ in range(seeds):
        log, following, own = noisy_blocks(rng, rates, name, figures)
        problem = CurveProblem((log,), 2, figures, FS)
        selection = select_model(problem)
        out["refuted"].append(selection.nonlinear)
        out["chosen"].append(selection.model)
        fit = selection.fits[fitted]
        end = float(log.end[-1])
        errors = []
        for horizon, mean in (
            (problem.horizon(end, end + 300), following),
            (problem.own_span(), own),
        ):
            bias = fit.curve(np.zeros(1), horizon)
            errors.append((bias.value[0] - 60 * DPH - mean) / bias.sigma[0])
        K = scale_factor(fit)
        true_K = {"line": 900.0, "cubic": 763.5635, "asym": 900.0}.get(name)
        errors.append((K.value / PPM - true_K) / (K.sigma / PPM) if true_K else 0.0)
        out["error"].append(errors)
        given = select_model(problem, fitted)
        NL = nonlinearity(given)
        out["nl"].append((NL.value / PPM, NL.sigma / PPM))
        out["nl_raw"].append(NL.raw / PPM)
    return {key: np.array(value) for key, value in out.items()}


def test_sigmas_equal_the_scatter_of_simulated_tests():
    result = campaign("NAV440", "line", 60)
    # 60 draws: the standard deviation scatters by 9 %.
    assert np.all(np.abs(result["error"].std(axis=0) - 1) < 0.28)
    assert np.all(np.abs(result["error"].mean(axis=0)) < 0.4)
    assert result["refuted"].mean() <= 0.05


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("imu", "name", "power"),
    [
        ("NAV440", "cubic", 0.88),
        ("NAV440", "asym", 1.0),
        ("NAV440", "knee", 0.98),
        ("MTi-G", "cubic", 0.12),
        ("MTi-G", "asym", 0.43),
        ("MTi-G", "knee", 0.18),
    ],
)
def test_nonlinear_truths_refute_the_line_as_often_as_published(imu, name, power):
    result = campaign(imu, name, 1000)
    assert result["refuted"].mean() == pytest.approx(power, abs=0.04)
    used = [0, 1] if name == "knee" else [0, 1, 2]
    assert np.all(np.abs(result["error"][:, used].std(axis=0) - 1) < 0.1)
    assert np.all(np.abs(result["error"][:, used].mean(axis=0)) < 0.2)


@pytest.mark.campaign
@pytest.mark.parametrize("imu", IMUS)
def test_a_true_line_is_refuted_in_one_percent(imu):
    result = campaign(imu, "line", 2000)
    assert result["refuted"].mean() <= 0.025
    assert np.all(np.abs(result["error"].std(axis=0) - 1) < 0.06)
    raw = {"NAV440": (41.1, 64.9), "MTi-G": (93.4, 147.3)}[imu]
    got = result["nl_raw"].mean(), np.quantile(result["nl_raw"], 0.95)
    np.testing.assert_allclose(got, raw, rtol=0.04)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("imu", "name", "mean", "scatter", "sigma"),
    [
        ("NAV440", "cubic", 90.1, 20.8, 21.4),
        ("NAV440", "asym", 119.8, 20.2, 19.1),
        ("MTi-G", "cubic", 96, 39, 46),
        ("MTi-G", "asym", 120, 41, 39.9),
    ],
)
def test_the_nonlinearity_has_the_published_mean_and_scatter(imu, name, mean, scatter, sigma):
    nl = campaign(imu, name, 1000)["nl"]
    assert nl[:, 0].mean() == pytest.approx(mean, rel=0.04)
    assert nl[:, 0].std() == pytest.approx(scatter, rel=0.1)
    assert np.median(nl[:, 1]) == pytest.approx(sigma, rel=0.06)


def test_the_truths_are_the_published_curves():
    assert TRUTHS["cubic"](np.array(1.0)) == -30.0
    assert TRUTHS["asym"](np.array(-1.0)) == pytest.approx(72.0)
    assert TRUTHS["knee"](np.array(0.15)) == pytest.approx(60 * np.tanh(1))
