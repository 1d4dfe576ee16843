"""Expected RMS of R16's run with the budget's sensor errors, before any test."""

from collections.abc import Sequence

from rotcli.budget.sensors import Sensors
from rotcli.models.expected.motion import StillTable
from rotcli.models.expected.plan import PlannedSensors
from rotcli.models.expected.planned_runs import PlannedExpectation, planned_expectation
from rotcli.units import FloatArray


def budget_expectation(
    sensors: Sensors,
    table: StillTable,
    *,
    axes: Sequence[str],
    rate: float,
    duration: float,
    matrix_sigma: float = 0.0,
    attitude_sigma: FloatArray | None = None,
) -> PlannedExpectation:
    """Return the expected RMS of conventional, partial and full navigation.

    rate: rad/s, the budget's; others up to 100 deg/s come with it. matrix_sigma: of the gyro
    matrix where nothing is known of it.
    """
    missing = sensors.missing_noise()
    if missing:
        return PlannedExpectation(reason=f"no {', '.join(missing)}")
    planned = PlannedSensors(
        gyro=(sensors.gyro_noise(),),
        accel=(sensors.accel_noise(),),
        matrix=sensors.gyro.matrix,
        matrix_sigma=matrix_sigma,
        accel_bias=sensors.accel_bias,
    )
    return planned_expectation(
        planned, table, axes=axes, rate=rate, duration=duration, attitude_sigma=attitude_sigma
    )
