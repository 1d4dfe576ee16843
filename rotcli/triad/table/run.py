"""Full calibration from the logs of a table run: problem, checks, estimate, findings."""

from dataclasses import replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.logs.record import ImuSource, Progress
from rotcli.logs.table_axes import AxesLog
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import STILL, Blocks, expected_means
from rotcli.models.triad.correction import correct_accel
from rotcli.models.triad.information import CHUNK_BLOCKS, Problem
from rotcli.models.triad.kinematics import Table
from rotcli.rig.noise_sources import accel_noise, gyro_noise
from rotcli.rig.rig import ImuSettings, Rig
from rotcli.run.findings import Finding
from rotcli.triad.drift import Drift
from rotcli.triad.estimate import Fit
from rotcli.triad.residuals import residual_findings
from rotcli.triad.result import (
    ALL_NOISE,
    WHITE_NOISE,
    TriadResult,
    choose_convention,
    estimates_of,
    null_directions,
)
from rotcli.triad.selection import assumed_zero, weighted_fit, without_unseen_groups
from rotcli.triad.table.diagnosis import diagnose
from rotcli.triad.table.inputs import nominal_table, samples_of, unused_time, with_mountings
from rotcli.triad.table.reduction import TableLog as ReducedTable
from rotcli.triad.table.reduction import reduce_logs
from rotcli.triad.table.signs import (
    MAX_MISFIT,
    MAX_MOUNTING_ANGLE,
    SignCheck,
    check_signs,
    mount_rows,
)
from rotcli.units import DEG, FloatArray

MIN_TABLE_ROWS = 20  # one block needs six
MIN_BLOCKS = 10  # per six readings: 60 means for at most 60 parameters
# Sigma of one sample where a log has less noise: the means of moving blocks are exact to 1e-8 rad/s
# and 3e-6 m/s^2 over some 50 samples. No gyro or accelerometer is as quiet (0.0001 deg/sqrt(h)).
MODEL_FLOOR_GYRO, MODEL_FLOOR_ACCEL = 1e-7, 2e-5  # rad/s, m/s^2
NOISE_RATIO = 1.5  # measured white noise over the rig's before a finding is made


@dataclass(frozen=True)
class TriadOptions:
    """Choices of a calibration: parameter groups, convention, slow noise of the biases or not."""

    groups: str = p.BASIC
    convention: str = "auto"
    drift: bool = True


def calibrate_on_table(
    imu: ImuSource,
    table: AxesLog,
    rig: Rig,
    options: TriadOptions,
    progress: Progress | None = None,
) -> TriadResult:
    """Return the full calibration of an IMU log on a table of one to three axes.

    Raises RigError without a site, LogError when the logs do not fit the rig.
    """
    if len(table.time) < MIN_TABLE_ROWS:
        raise LogError(
            table.path, f"{len(table.time)} rows; at least {MIN_TABLE_ROWS} are necessary"
        )
    clock, chunks = samples_of(imu, rig.imu, progress)
    nominal = nominal_table(rig)
    reduced = ReducedTable(table.time, table.angles)
    blocks, variance, _ = reduce_logs(chunks, clock, imu.samples, reduced)
    blocks = with_mountings(blocks, rig, imu.interval)
    if len(blocks) < MIN_BLOCKS:
        raise LogError(
            table.path,
            f"{len(blocks)} blocks of constant table acceleration within the IMU log; record "
            "still segments and turns, and check [table] time_offset",
        )
    check = check_signs(nominal, blocks)
    _reject_wrong_signs(check, nominal, blocks, rig, imu.path)
    problem, noise = _problem(rig, nominal, options, variance, imu.interval)
    drift = _drift(rig.imu, imu.interval) if options.drift else None
    complete, factors = weighted_fit(problem, blocks, drift)
    fit, factors, assumed = without_unseen_groups(
        complete, factors, blocks, drift, options.convention
    )
    ratio = np.sqrt(variance) / problem.sigma_1
    white = np.array([ratio[:3].max(), ratio[3:].max()])
    findings = [*noise, *residual_findings(fit, factors, blocks, imu.path, white)]
    used = float(blocks.count.sum()) * imu.interval
    findings += unused_time(used, table, imu)
    if assumed:
        findings.append(assumed_zero(assumed, imu.path))
    result = _result(fit, factors, blocks, options, findings, check)
    order = p.names(nominal.mounting_count)
    everything = sorted((*result.estimates, *assumed), key=lambda e: order.index(e.name))
    return replace(
        result,
        estimates=tuple(everything),
        null_directions=null_directions(complete),
        rank=complete.rank.rank,
    )


def _reject_wrong_signs(
    check: SignCheck, table: Table, blocks: Blocks, rig: Rig, path: str
) -> None:
    """Raise LogError where the readings contradict the signs or mountings of the rig."""
    if not check.explained:
        raise LogError(path, diagnose(table, blocks, check, rig.table))
    wrong = check.wrong_axes
    if wrong:
        signs = rig.table.directions or (rig.table.direction,) * table.axis_count
        right = [s * b for s, b in zip(signs, check.best.signs, strict=True)]
        key = f"directions = {right}" if table.axis_count > 1 else f"direction = {right[0]}"
        which = ", ".join(str(k + 1) for k in wrong)
        if check.logged.misfit < MAX_MISFIT:
            raise LogError(
                path,
                f"gyros and gravity need the other direction of table axis {which}, or an IMU "
                f"that is mounted turned by 180 deg; set [table] {key}, or [imu] mount",
            )
        raise LogError(
            path,
            f"gyros and gravity contradict the direction of table axis {which} (misfit "
            f"{check.logged.misfit:.0%}, reversed {check.best.misfit:.0%}); set [table] {key}",
        )
    for m, angle in enumerate(check.best.angles):
        if angle > MAX_MOUNTING_ANGLE:
            mount = rig.mountings[m].mount if rig.mountings else rig.imu.mount
            found = mount_rows(mount, check.best.rotations[m], applied=not rig.mountings)
            rows = np.round(found, 4) + 0.0
            text = "[" + ", ".join("[" + ", ".join(f"{v:g}" for v in r) + "]" for r in rows) + "]"
            place = f"[[mountings]] {m + 1}: mount" if rig.mountings else "[imu] mount"
            raise LogError(
                path,
                f"the IMU is mounted {np.rad2deg(angle):.0f} deg away from the rig's mounting; "
                f"set {place} = {text}",
            )


def _problem(
    rig: Rig, table: Table, options: TriadOptions, variance: FloatArray, interval: float
) -> tuple[Problem, list[Finding]]:
    """Return free parameters, priors and noise, and findings on the noise."""
    mountings = table.mounting_count
    priors = p.weak_priors(mountings)
    if rig.site is not None and rig.site.gravity_sigma is not None:
        priors[p.GRAVITY] = rig.site.gravity_sigma
    if rig.attitude.azimuth_sigma is not None:
        priors[p.BASE_AZIMUTH] = rig.attitude.azimuth_sigma
    free = p.select(options.groups, table.axis_count, mountings=mountings)
    for m, mounting in enumerate(rig.mountings):
        first = p.FIXED_COUNT + 3 * (m - 1)
        if m and mounting.sigma is not None:
            priors[first : first + 3] = mounting.sigma
            if mounting.sigma == 0.0:
                free = free[(free < first) | (free >= first + 3)]
    measured = np.sqrt(variance)
    sigma, findings = measured.copy(), []
    for name, unit, part, shown in (
        ("angle_random_walk", "deg/s", slice(0, 3), DEG),
        ("velocity_random_walk", "m/s^2", slice(3, 6), 1.0),
    ):
        given = rig.imu.figure(name)
        if given is None or not np.all(given > 0.0):
            continue
        sigma[part] = given / np.sqrt(interval)
        ratio = float(np.max(measured[part] / sigma[part]))
        if ratio > NOISE_RATIO:
            findings.append(
                Finding(
                    "noise-larger-than-rig",
                    f"{rig.path or 'rig'}: [imu] {name}: the log's white noise is {ratio:.2g} "
                    f"times larger (one sample {measured[part].max() / shown:.3g} {unit}). The "
                    "rig's figure weights the data; measure it with allan",
                    value=ratio,
                    limit=NOISE_RATIO,
                )
            )
    floor = np.repeat([MODEL_FLOOR_GYRO, MODEL_FLOOR_ACCEL], 3)
    return Problem(table, free, priors, np.maximum(sigma, floor)), findings


def _drift(imu: ImuSettings, interval: float) -> Drift | None:
    """Return the slow noise of the biases by the rig's noise figures, None where it names none.

    interval: s between samples.
    """
    found: list[SlowNoise] = []
    for triad in (gyro_noise(imu), accel_noise(imu)):
        slow = [one for _, one in triad]
        found += slow * 3 if len(slow) == 1 else slow
    drift = Drift(tuple(found), interval)
    return drift if drift else None


def _result(
    fit: Fit,
    factors: tuple[float, float],
    blocks: Blocks,
    options: TriadOptions,
    findings: list[Finding],
    check: SignCheck,
) -> TriadResult:
    """Return the result in the convention asked for."""
    convention = choose_convention(fit, options.convention)
    estimates, covariance = estimates_of(fit, convention)
    table = fit.problem.table
    nothing = np.zeros(len(fit.x))
    parts = [expected_means(table, nothing, chunk) for chunk in blocks.chunks(CHUNK_BLOCKS)]
    before = blocks.means - np.concatenate(parts, axis=1)
    still = blocks.kind == STILL
    gravity = table.gravity + fit.x[p.GRAVITY]
    size = np.linalg.norm(blocks.means[3:], axis=0) - gravity
    corrected = np.linalg.norm(correct_accel(fit.x, blocks.means[3:].T), axis=1) - gravity
    series = {
        "time [s]": blocks.time,
        "kind": blocks.kind.astype(float),
        # Only still blocks have a force of the size of gravity.
        "gravity_before [m/s^2]": np.where(still, size, np.nan),
        "gravity_after [m/s^2]": np.where(still, corrected, np.nan),
        **{f"gyro_{a}_before [deg/s]": before[k] / DEG for k, a in enumerate("xyz")},
        **{f"gyro_{a}_after [deg/s]": fit.residuals[k] / DEG for k, a in enumerate("xyz")},
        **{f"accel_{a}_before [m/s^2]": before[3 + k] for k, a in enumerate("xyz")},
        **{f"accel_{a}_after [m/s^2]": fit.residuals[3 + k] for k, a in enumerate("xyz")},
    }
    noise = ALL_NOISE if fit.drift else WHITE_NOISE
    rms = [float(np.sqrt(np.mean(v[still] ** 2))) if still.any() else None
           for v in (size, corrected)]  # fmt: skip
    details: dict[str, object] = {
        "axes": table.axes.tolist(),
        "mountings": table.mounting_count,
        "blocks": len(blocks),
        "passes": fit.passes,
        "sign_misfit": check.best.misfit,
        "force_rms_before": rms[0],
        "force_rms_after": rms[1],
        "free": len(fit.problem.free),
        "noise_factor_gyro": factors[0],
        "noise_factor_accel": factors[1],
    }
    return TriadResult(
        "table", convention, estimates, covariance, null_directions(fit), fit.rank.rank,
        fit.chi2, fit.dof, fit.scale, noise, tuple(fit.kinds), tuple(findings), details, series,
        (float(blocks.time[0]), float(blocks.time[-1])),
    )  # fmt: skip
