"""What a single-axis rotation INS can observe: the stripped observability matrix and the filter.

Raw singular values depend on the units, so the unit-free degree `1 - sigma(T)/sigma(0)` of the
16-state filter stands beside them. Source: the SRINS level-damping paper ("S"), its table 1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.srins import model
from rotcli.srins.filter import FilterSettings, build_filter_model, gain_sequence
from rotcli.srins.model import VehicleMotion
from rotcli.srins.reciprocation import Reciprocation

Array = NDArray[np.float64]

THRESHOLD = 1e-5  # the paper's, on singular values in SI units
SCHEMES = ("still", "one-stop", "two-stop")


@dataclass(frozen=True, eq=False)
class SrinsObservability:
    """singular_values: (16,) in SI units at a fixed angle; rank: of those above THRESHOLD.

    true_rank: 16 less the unobservable directions at a fixed angle, from exact structure.
    degrees, sigma: (16,) of each rotation scheme of SCHEMES, after `hours` of the filter.
    """

    singular_values: Array
    rank: int
    true_rank: int
    hours: float
    degrees: dict[str, Array]
    sigma: dict[str, Array]


def observe(
    motion: VehicleMotion, settings: FilterSettings, rotation: Reciprocation, hours: float = 10.0
) -> SrinsObservability:
    """Return the observability of a cruise: at a fixed angle, and in each rotation scheme."""
    F = model.srins_error_dynamics(motion, settings.damping, 0.0)
    H = model.measurement_matrix(damping_states=False)
    matrix = model.stripped_observability_matrix(F, H)
    singular: Array = np.linalg.svd(matrix, compute_uv=False).astype(float)
    degrees, sigmas = {}, {}
    sigma0 = settings.initial_sigma(motion.latitude)
    for kind in SCHEMES:
        scheme = Reciprocation(rotation.rate, rotation.dwell, kind)
        sigmas[kind] = cruise_sigma(motion, settings, scheme, hours)[-1]
        degrees[kind] = 1.0 - sigmas[kind] / sigma0
    return SrinsObservability(
        singular_values=singular,
        rank=int(np.count_nonzero(singular > THRESHOLD)),
        true_rank=_true_rank(F, H),
        hours=hours,
        degrees=degrees,
        sigma=sigmas,
    )


def cruise_sigma(
    motion: VehicleMotion, settings: FilterSettings, rotation: Reciprocation, hours: float
) -> Array:
    """Return the filter's sigma (m, 16) over a cruise at constant velocity, an epoch a second."""
    n = round(hours * 3600.0 / settings.interval) * round(settings.interval)
    theta = rotation.angle(np.arange(n + 1, dtype=float))
    velocity = np.ones((2, n + 1)) * [[motion.v_east], [motion.v_north]]
    latitude = np.full(n + 1, motion.latitude)
    epochs = np.ones(n, dtype=np.int64)
    steps = build_filter_model(theta, velocity, latitude, 1.0, settings, epochs)
    return gain_sequence(steps, np.diag(settings.initial_sigma(motion.latitude) ** 2)).sigma


def _true_rank(F: Array, H: Array) -> int:
    """Return the rank of the observability matrix once states and time are scaled to one size.

    The rank does not depend on units; only its numerical visibility does. States are measured in
    what one Schuler radian makes of a metre per second.
    """
    g, ws = F[1, 2], np.sqrt(F[1, 2] * F[3, 0])
    unit = np.ones(16)
    unit[2:5] = ws / g
    unit[5:7] = ws / g
    unit[7:10] = ws**2 / g
    unit[10:12] = ws
    scaled = F * unit[None, :] / unit[:, None] / ws
    rows = [H * unit]
    for _ in range(15):
        row = rows[-1] @ scaled
        rows.append(row / max(1.0, float(np.abs(row).max())))
    singular = np.linalg.svd(np.concatenate(rows), compute_uv=False)
    return int(np.count_nonzero(singular > 1e-9 * singular[0]))
