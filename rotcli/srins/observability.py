"""Observability of a single-axis rotation INS: stripped observability matrix, and the filter.

Raw singular values depend on the units; the degree `1 - sigma(T)/sigma(0)` of the 16-state filter
does not. Source: the SRINS level-damping paper ("S"), its table 1.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.srins import model
from rotcli.srins.filter import FilterSettings, build_filter_model, gain_sequence
from rotcli.srins.model import VehicleMotion
from rotcli.srins.reciprocation import RotationScheme
from rotcli.units import FloatArray

_ROUNDING = 1e-12  # of the largest singular value: smaller ones are zero
_EQUAL = 1e-3  # relative difference of singular values that belong together
THRESHOLD = 1e-5  # the paper's, on singular values in SI units
SCHEMES = ("still", "one-stop", "two-stop")


@dataclass(frozen=True, eq=False)
class SrinsObservability:
    """Observability at a fixed angle, and under rotation.

    singular_values: (16,) in SI; singular_states: the state that each belongs to, by its right
    singular vector. rank: of the values above THRESHOLD. true_rank: 16 less the unobservable
    directions at a fixed angle, from exact structure.
    degrees, sigma: (16,) of each rotation scheme of SCHEMES, after `hours` of the filter.
    """

    singular_values: FloatArray
    singular_states: tuple[str, ...]
    rank: int
    true_rank: int
    hours: float
    degrees: dict[str, FloatArray]
    sigma: dict[str, FloatArray]


def observe(
    motion: VehicleMotion, settings: FilterSettings, rotation: RotationScheme, hours: float = 10.0
) -> SrinsObservability:
    """Return the observability of a cruise: at a fixed angle, and in each rotation scheme."""
    F = model.srins_error_dynamics(motion, settings.damping, 0.0)
    H = model.measurement_matrix(damping_states=False)
    matrix = model.stripped_observability_matrix(F, H)
    _, singular, Vt = np.linalg.svd(matrix)
    degrees, sigmas = {}, {}
    sigma0 = settings.initial_sigma(motion.latitude)
    for kind in SCHEMES:
        scheme = RotationScheme(rotation.rate, rotation.dwell, kind)
        sigmas[kind] = cruise_sigma(motion, settings, scheme, hours)[-1]
        degrees[kind] = 1.0 - sigmas[kind] / sigma0
    return SrinsObservability(
        singular_values=singular,
        singular_states=dominant_states(singular, Vt),
        rank=int(np.count_nonzero(singular > THRESHOLD)),
        true_rank=_true_rank(F, H),
        hours=hours,
        degrees=degrees,
        sigma=sigmas,
    )


def dominant_states(singular: FloatArray, Vt: FloatArray) -> tuple[str, ...]:
    """Return the state of each singular value (n,): that with the largest share of its vector.

    Vt: (n, n), right singular vectors as rows. The vectors of equal values are any basis of their
    subspace; their states are those with the largest shares of the subspace, each once.

    >>> Vt = np.array([[0.6, 0.8, 0.0], [0.8, -0.6, 0.0], [0.0, 0.0, 1.0]])
    >>> dominant_states(np.array([2.0, 2.0, 1.0]), Vt)
    ('dV_N', 'dV_E', 'phi_E')
    """
    names: list[str] = []
    free = np.ones(len(singular), dtype=bool)
    for k, value in enumerate(singular):
        equal = np.abs(singular - value) <= _EQUAL * max(value, _ROUNDING * singular[0])
        share = np.where(free, (Vt[equal] ** 2).sum(axis=0), -1.0)
        weight = np.where(free, Vt[k] ** 2, -1.0)
        # Of nearly equal shares of the subspace the larger share of this vector decides.
        best = int(np.argmax(np.round(share, 2) + 1e-3 * weight))
        free[best] = False
        names.append(model.STATES[best])
    return tuple(names)


def cruise_sigma(
    motion: VehicleMotion, settings: FilterSettings, rotation: RotationScheme, hours: float
) -> FloatArray:
    """Return the filter's sigma (m, 16) over a cruise at constant velocity, an epoch a second."""
    n = round(hours * 3600.0 / settings.interval) * round(settings.interval)
    theta = rotation.angle(np.arange(n + 1, dtype=float))
    velocity = np.ones((2, n + 1)) * [[motion.v_east], [motion.v_north]]
    latitude = np.full(n + 1, motion.latitude)
    epochs = np.ones(n, dtype=np.int64)
    steps = build_filter_model(theta, velocity, latitude, 1.0, settings, epochs)
    return gain_sequence(steps, np.diag(settings.initial_sigma(motion.latitude) ** 2)).sigma


def _true_rank(F: FloatArray, H: FloatArray) -> int:
    """Return the rank of the observability matrix once states and time are scaled to one size.

    The rank does not depend on units; only its numerical visibility does. States are measured in
    what one Schuler radian makes of a metre per second.
    """
    at = model.LAYOUT.index
    g, curvature = F[at("dV_N"), at("phi_E")], F[at("phi_N"), at("dV_E")]
    ws = np.sqrt(g * curvature)
    unit = np.ones(len(model.STATES))
    unit[model.ATTITUDE] = unit[model.POSITION] = ws / g
    unit[model.GYRO_BIAS] = ws**2 / g
    unit[model.ACCEL_BIAS] = ws
    scaled = F * unit[None, :] / unit[:, None] / ws
    rows = [H * unit]
    for _ in range(15):
        row = rows[-1] @ scaled
        rows.append(row / max(1.0, float(np.abs(row).max())))
    singular = np.linalg.svd(np.concatenate(rows), compute_uv=False)
    return int(np.count_nonzero(singular > 1e-9 * singular[0]))
