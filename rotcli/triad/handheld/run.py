"""Full calibration of a hand-held log: checks, both stages, result."""

import numpy as np

from rotcli.errors import LogError
from rotcli.logs.record import ImuLog
from rotcli.models.earth import EARTH_RATE, gravity_at
from rotcli.models.triad import parameters as p
from rotcli.rig.rig import Rig
from rotcli.run.findings import Finding
from rotcli.triad.handheld.estimate import (
    MIN_DIRECTION_SPREAD,
    AccelFit,
    GyroFit,
    direction_spread,
    fit_accelerometers,
    fit_gyros,
)
from rotcli.triad.handheld.poses import MAX_MOVE, MIN_POSES, Poses, find_poses
from rotcli.triad.result import ESTIMATED, NULL, Estimate, TriadResult
from rotcli.units import DEG, STANDARD_GRAVITY, FloatArray

STANDARD_SITE = "9.80665 m/s^2 (standard gravity)"
_SIGNIFICANT = 3.0  # sigmas of a second-order term
_LOWER = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))


def calibrate_by_hand(log: ImuLog, rig: Rig) -> TriadResult:
    """Return the calibration of a log with at least twelve still poses and moves between them.

    Raises LogError when the log has too few poses or too few directions.
    """
    findings = []
    if rig.site is None:
        gravity, vertical = STANDARD_GRAVITY, 0.0
        findings.append(
            Finding(
                "site-missing",
                f"{rig.path or 'no rig.toml'}: [site] is missing. Gravity is assumed as "
                f"{STANDARD_SITE} and Earth rate is left in the g-sensitivity; set latitude "
                "and height",
            )
        )
    else:
        gravity = gravity_at(rig.site.latitude, rig.site.height, rig.site.gravity)
        vertical = EARTH_RATE * float(np.sin(rig.site.latitude))
    poses = find_poses(log.gyro, log.accel, log.interval)
    _check_poses(log, poses)
    accel = fit_accelerometers(poses, gravity)
    second = fit_accelerometers(poses, gravity, second_order=True)
    gyro = fit_gyros(log.gyro, log.accel, poses, accel, gravity=gravity, vertical_earth=vertical)
    gravity_sigma = p.DEFAULT_GRAVITY_SIGMA
    if rig.site is not None and rig.site.gravity_sigma is not None:
        gravity_sigma = rig.site.gravity_sigma
    estimates, covariance = _estimates(accel, gyro, second, gravity, gravity_sigma)
    details: dict[str, object] = {
        "poses": len(poses),
        "longest_move_s": float((poses.first[1:] - poses.end[:-1]).max() * poses.interval),
        "gravity": gravity,
        "force_rms_before": accel.rms_before,
        "force_rms_after": accel.rms,
        "carried_rms_before_deg": gyro.rms_before / DEG,
        "carried_rms_fitted_deg": gyro.rms / DEG,
        "carried_rms_held_out_deg": gyro.excluded_rms / DEG,
        "accel_chi2_per_dof": accel.chi2 / accel.dof,
        "gyro_chi2_per_dof": gyro.chi2 / gyro.dof,
        "white_noise_gyro_dps": (poses.gyro_noise / DEG).tolist(),
        "white_noise_accel_mps2": poses.accel_noise.tolist(),
    }
    force = np.linalg.norm(poses.accel, axis=1) - gravity
    series = {
        "time [s]": log.time[0] + poses.time,
        "force_before [m/s^2]": force,
        "force_after [m/s^2]": accel.residuals,
        "carried_before [deg]": np.append(np.hypot(*gyro.residuals_before.T) / DEG, np.nan),
        "carried_after [deg]": np.append(np.hypot(*gyro.residuals.T) / DEG, np.nan),
    }
    chi2, dof = accel.chi2 + gyro.chi2, accel.dof + gyro.dof
    return TriadResult(
        "hand-held", "accelerometer", estimates, covariance, [], None, chi2, dof,
        float(np.sqrt(max(1.0, chi2 / dof))), "white noise, scaled by the residuals of each stage",
        (), tuple(findings), details, series, _span(log, poses),
    )  # fmt: skip


def _span(log: ImuLog, poses: Poses) -> tuple[float, float]:
    """Return the middle of the first and of the last pose, s."""
    start = float(log.time[0])
    return start + float(poses.time[0]), start + float(poses.time[-1])


def _check_poses(log: ImuLog, poses: Poses) -> None:
    """Raise LogError for too few poses, too few directions or a move that is too long."""
    if len(poses) < MIN_POSES:
        raise LogError(
            log.path,
            f"{len(poses)} still poses of at least 1.5 s found, {MIN_POSES} are necessary; hold "
            "the IMU still for 3 s or longer in 12 or more different attitudes, or give the "
            "log of the table",
        )
    spread = direction_spread(poses.accel)
    if spread < MIN_DIRECTION_SPREAD:
        raise LogError(
            log.path,
            f"the poses show gravity almost in one plane (spread {spread:.3f}, at least "
            f"{MIN_DIRECTION_SPREAD:g} is necessary); add poses with every side of the case down",
        )
    longest = float((poses.first[1:] - poses.end[:-1]).max() * poses.interval)
    if longest > MAX_MOVE:
        raise LogError(
            log.path,
            f"the longest move lasts {longest:.3g} s, at most {MAX_MOVE:g} s are allowed: gyro "
            "drift hides its end; make the moves short, with a still pose after each",
        )


def _estimates(
    accel: AccelFit, gyro: GyroFit, second: AccelFit, gravity: float, gravity_sigma: float
) -> tuple[tuple[Estimate, ...], FloatArray]:
    """Return the parameters in the accelerometer convention and their covariance."""
    x, sigma = np.zeros(p.count()), np.zeros(p.count())
    order = list(range(p.N.start, p.ACCEL_BIAS.stop))
    full = np.zeros((p.count(), p.count()))
    x[p.N], x[p.GYRO_BIAS], x[p.G] = gyro.matrix.ravel(), gyro.bias, gyro.G.ravel()
    full[p.N, p.N] = gyro.covariance
    full[p.GYRO_BIAS, p.GYRO_BIAS] = np.diag(gyro.bias_sigma**2)
    full[p.G, p.G] = np.diag(gyro.G_sigma.ravel() ** 2)
    at = [p.M.start + 3 * r + c for r, c in _LOWER] + list(range(33, 36))
    x[p.M], x[p.ACCEL_BIAS] = accel.matrix.ravel(), accel.bias
    covariance = accel.covariance.copy()
    # A wrong gravity scales all accelerometers alike.
    common = np.zeros(9)
    for k, (r, c) in enumerate(_LOWER):
        common[k] = (float(r == c) + accel.matrix[r, c]) / gravity * gravity_sigma
    covariance += np.outer(common, common)
    full[np.ix_(at, at)] = covariance
    sigma = np.sqrt(np.diag(full))
    factor, unit = p.unit_factors(), p.unit_names()
    order = [k for k in order if not p.GYRO_ASYMMETRY.start <= k < p.GYRO_ASYMMETRY.stop]
    found = []
    for k in order:
        zero = p.M.start <= k < p.M.stop and sigma[k] == 0.0
        reason = "zero by convention" if zero else ""
        values = float(x[k] / factor[k]), float(sigma[k] / factor[k])
        found.append(Estimate(p.NAMES[k], *values, unit[k], ESTIMATED, reason))
    matrix = full[np.ix_(order, order)] / np.outer(factor[order], factor[order])
    K2_sigma = np.sqrt(np.diag(second.covariance))[9:]
    for i, k in enumerate(range(p.K2.start, p.K2.stop)):
        size = abs(float(second.K2[i])) / float(K2_sigma[i])
        text = f"{second.K2[i] / factor[k]:.3g} {unit[k]}, {size:.2g} sigma: "
        text += "significant, but not used" if size > _SIGNIFICANT else "not significant"
        shown = float(K2_sigma[i] / factor[k])
        found.append(Estimate(p.NAMES[k], None, shown, unit[k], NULL, text))
    return tuple(found), matrix
