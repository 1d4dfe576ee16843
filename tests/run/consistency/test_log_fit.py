"""Which of two causes is reported where a log contradicts its fit and leaves sines."""

import numpy as np
import pytest

from rotcli.run.consistency.goodness import FitTest, GyroTest
from rotcli.run.consistency.log_fit import LogFit
from rotcli.run.findings import Finding

FIT = Finding("fit-contradicted", "imu: the fit", where="gyro_y")
REST = Finding("fit-contradicted", "imu: the fit without the sines", where="gyro_y")
SINES = Finding("rate-varies", "imu: sines", where="gyro_y")


class Sines:
    value = np.ones((4, 3))


def outcome(monkeypatch, before, after, varying=(SINES,), **more):
    """Return codes and test of a log of chi-squared `before`, `after` without the sines (of y)."""

    def fit_test(_, harmonics=None):
        gyros = [GyroTest(chi2, 20, 40.0) for chi2 in (10.0, before, 10.0)]
        if harmonics is None:
            return FitTest(tuple(gyros), (FIT,), (30.0,))
        gyros[1] = GyroTest(after, 16, 35.0)
        return FitTest(tuple(gyros), (REST,) if after > 35.0 else ())

    monkeypatch.setattr(LogFit, "_fit_test", fit_test)
    monkeypatch.setattr(
        LogFit, "_harmonics", lambda _, steps: Sines() if steps == (30.0,) else None
    )
    monkeypatch.setattr(LogFit, "_judged", lambda *_: varying)
    one = LogFit("imu", None, (), np.eye(3)[2], None, None, None, known=True, **more)
    return one.test()


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (100.0, 30.0, (SINES,)),  # the sines explain it all
        (100.0, 49.0, (REST, SINES)),  # more than half of it
        (100.0, 51.0, (FIT,)),  # less: something else causes the sines
        (60.0, 34.0, (SINES,)),  # not contradicted without the sines
    ],
)
def test_sines_are_the_cause_where_they_take_half_of_chi_squared_away(
    before, after, expected, monkeypatch
):
    test, findings = outcome(monkeypatch, before, after)
    assert findings == expected
    # The sigmas contain the contradiction as it was, with the sines in the residuals.
    assert test.gyros[1].chi2 == before
    assert isinstance(test.harmonics, Sines)


def test_without_significant_sines_the_fit_is_reported_alone(monkeypatch):
    _, findings = outcome(monkeypatch, 100.0, 30.0, varying=())
    assert findings == (FIT,)


@pytest.mark.parametrize(("scaled", "count"), [(True, 1), (False, 0)])
def test_disturbed_samples_are_the_cause_where_they_are_known(scaled, count, monkeypatch):
    test, findings = outcome(monkeypatch, 80.0, 30.0, explained=True, scaled=scaled)
    assert test.harmonics is None
    assert len(findings) == count
    for finding in findings:
        assert "chi-squared 80, limit 40); its sigmas are multiplied by 2" in finding.text
