"""A navigation-grade IMU, almost free of noise, turned by 90 deg about one axis after the other.

The schedule is that of the 19-position calibration in the literature (Xie Bo et al., JCIT 2011):
9 s per turn, the rate smoothed by 0.1 s, so that no step has a constant acceleration. Angles are
exact functions of time; readings are increments in single precision.
"""

import numpy as np
import pytest

from rotcli.logs.record import ImuLog
from rotcli.logs.table_axes import AxesLog
from rotcli.models.rotation import attitude_matrix
from rotcli.models.triad import parameters as p
from rotcli.rig.rig import rig_from_dict
from rotcli.simulate.sequence import SequenceSetup, simulate_sequence
from rotcli.triad.table.run import TriadOptions, calibrate_on_table
from rotcli.units import DEG, DEG_PER_HOUR

_LATITUDE, _GRAVITY = 34.0 * DEG, 9.7965
_SMOOTHING, _TURN_TIME, _HOLD, _FIRST = 0.1, 9.0, 20.0, 30.0  # s
_OUT_AND_BACK = [90.0] * 3 + [-90.0] * 3


class _SmoothedTurns:
    """Turns by some angles (axis, deg), rates smoothed by a first-order lag."""

    def __init__(self, axes, turns):
        self.axes = axes
        begin = _FIRST + (_TURN_TIME + _HOLD) * np.arange(len(turns))
        self.turns = list(zip(begin, turns, strict=True))
        edges = np.concatenate([[0.0], np.column_stack([begin, begin + _TURN_TIME]).ravel()])
        self.start = np.append(edges, begin[-1] + _TURN_TIME + _HOLD)
        self.duration = float(self.start[-1])
        self.mounting = np.zeros(len(self.start), dtype=np.int64)

    def step(self, time):
        return np.clip(np.searchsorted(self.start, time, side="right") - 1, 0, len(self.start) - 2)

    def at(self, time, step=None):
        moved = np.zeros((3, self.axes, len(time)))
        for begin, (axis, angle) in self.turns:
            for edge, rate in ((begin, angle), (begin + _TURN_TIME, -angle)):
                rate = rate * DEG / _TURN_TIME * (time >= edge)
                since = np.maximum(time - edge, 0.0)
                decay = np.exp(-since / _SMOOTHING)
                moved[0, axis] += rate * (since - _SMOOTHING * (1.0 - decay))
                moved[1, axis] += rate * (1.0 - decay)
                moved[2, axis] += rate * decay / _SMOOTHING
        return tuple(moved)


def _errors():
    x = np.zeros(p.count())
    x[p.N] = np.array([-10, 20.1, 30.2, 145.44, -20, 60.3, 242.41, 193.9, -30]) * 1e-6
    x[p.GYRO_BIAS] = np.array([-0.1, -0.2, -0.3]) * DEG_PER_HOUR
    x[p.M] = np.array([-10, 0, 0, -50, -20, 0, -60, -80, -30]) * 1e-6
    x[p.ACCEL_BIAS] = [-1e-3, -2e-3, -3e-3]
    x[p.K2] = np.array([-10, -20, -30]) * p.K2_UNIT
    x[p.LEVERS] = [-0.03, -0.02, 0.01, 0.02, -0.05, 0.03, 0.0, 0.0, 0.0]
    x[p.CLOCK_ACCEL] = -1e-3
    return x


def _calibrate(axes, turns, attitude):
    """Return the parameters with a value, and findings."""
    rig = rig_from_dict(
        {"site": {"latitude": 34.0, "height": 0.0, "gravity": _GRAVITY},
         "attitude": dict(zip(("pitch", "roll", "azimuth"), attitude, strict=True)),
         "imu": {"sampling": "increment"}, "table": {"axes": list(axes)}}
    )  # fmt: skip
    unit = dict(zip("xyz", np.eye(3), strict=True))
    setup = SequenceSetup(
        np.array([unit[a] for a in axes]), attitude_matrix(*np.deg2rad(attitude)),
        np.eye(3)[None], _LATITUDE, _GRAVITY,
    )  # fmt: skip
    motion = _SmoothedTurns(len(axes), turns)
    log = simulate_sequence(setup, motion, _errors(), sampling="increment")
    y = np.column_stack([log.gyro, log.accel]).astype(np.float32).astype(float) / 0.01
    imu = ImuLog("imu", log.time[1:], y[1:, :3], y[1:, 3:], 0.01, rows=len(y) - 1,
                 sampling="average")  # fmt: skip
    table = AxesLog("table", log.table_time, log.angles, 0.02, len(log.angles), (), None)
    return calibrate_on_table(imu, table, rig, TriadOptions())


def _differences(result, names):
    """Return value less truth in the units of the result."""
    factors, x = p.unit_factors(), _errors()
    found = {e.name: e.value for e in result.estimates}
    return {n: found[n] - x[p.INDEX[n]] / factors[p.INDEX[n]] for n in names}


@pytest.mark.parametrize(
    ("axis", "attitude"),
    [("x", (-88.585822, -134.995636, 136.004364)), ("y", (0.3, 0.2, -90)), ("z", (80, -40, 10))],
)
def test_one_axis_gives_its_column_to_a_twentieth_of_a_ppm(axis, attitude):
    result = _calibrate(axis, [(0, a) for a in _OUT_AND_BACK], attitude)
    column = [f"Kg{row}" if row == axis else f"Kg{row}{axis}" for row in "xyz"]
    assert max(abs(d) for d in _differences(result, column).values()) < 0.05
    biases = ("bias_x", "bias_y", "bias_z")
    assert max(abs(d) for d in _differences(result, biases).values()) < 0.005
    assert [f.code for f in result.findings] == ["assumed-zero"][: len(result.findings)]


def test_three_axes_give_both_matrices_to_a_twentieth_of_a_ppm():
    turns = [(0, a) for a in _OUT_AND_BACK] + [(1, 90.0)] + [(2, a) for a in _OUT_AND_BACK]
    turns += [(1, a) for a in (90.0, 90.0, -90.0, -90.0, -90.0)]
    result = _calibrate("xzy", turns, (-88.585822, -134.995636, 136.004364))
    matrices = [*p.GROUPS["N"].names, *p.GROUPS["M"].names, *p.GROUPS["K2"].names]
    assert max(abs(d) for d in _differences(result, matrices).values()) < 0.05
    assert max(abs(d) for d in _differences(result, p.GROUPS["d"].names).values()) < 0.003
    assert max(abs(d) for d in _differences(result, p.GROUPS["b"].names).values()) < 1e-5
    assert abs(_differences(result, ["clock_accel"])["clock_accel"]) < 0.1
    assert result.findings == ()
