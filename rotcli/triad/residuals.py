"""What the residuals of a table calibration contradict: by kind of block, over time, clocks."""

import numpy as np

from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import Blocks
from rotcli.run.findings import Finding
from rotcli.triad.bias_steps import STEP_SIGMAS, BiasStep, StepTest, whitened_rows
from rotcli.triad.estimate import Fit
from rotcli.units import DEG_PER_HOUR, FloatArray

CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")

CLOCK_SIGMAS = 4.0  # between the clock offsets of both halves
OUTLIER_SIGMAS = 7.0  # one of 1e5 Gaussian values exceeds it once in 4e6 logs
OUTLIER_SHARE = 0.1  # of the blocks; more of them are a wrong model
TURN_CHI2 = 1.5  # per row; above it blocks of a kind contradict the model


def residual_findings(
    fit: Fit, factors: tuple[float, float], blocks: Blocks, path: str, white: FloatArray
) -> list[Finding]:
    """Return what the residuals contradict.

    white: (2,) measured white noise of gyros and accelerometers over that of the weights; noise
    that is larger everywhere is no sign of one kind of block.
    """
    clocks, step = _over_time(fit, blocks, path)
    shock = _outliers(fit, factors, blocks, path)
    if step is not None and (not shock or step.sigmas > float(shock[0].value or 0.0)):
        # Behind a step the first blocks deviate as well: they are no shock.
        shock = [_step_of_bias(step, fit, path)]
    found = [*shock]
    expected = np.maximum(white, 1.0) ** 2
    if not fit.converged:
        found.append(
            Finding(
                "not-converged",
                f"{path}: the estimate did not converge in {fit.passes} passes; check the rig, or "
                "estimate fewer parameters",
            )
        )
    for kind in fit.kinds:
        ratios = np.array([kind.gyro, kind.accel]) * np.square(factors) / expected
        worst = float(ratios.max())
        limit = max(TURN_CHI2, 1.0 + 6.0 * np.sqrt(2.0 / (3.0 * kind.blocks)))
        if worst > limit:
            cause = {
                "still": "bias drift or temperature",
                "turn": "clock, levers, or axes that do not meet",
                "ramp": "the encoder lags while it accelerates",
            }[kind.kind]
            found.append(
                Finding(
                    f"{kind.kind}-residuals",
                    f"{path}: chi-squared of {kind.kind} blocks is {worst:.3g} per reading; "
                    f"probable cause: {cause}. The noise of the gyros is multiplied by "
                    f"{factors[0]:.3g}, of the accelerometers by {factors[1]:.3g}",
                    where=kind.kind,
                    value=worst,
                    limit=float(limit),
                )
            )
    return [*found, *clocks]


def _outliers(fit: Fit, factors: tuple[float, float], blocks: Blocks, path: str) -> list[Finding]:
    """Return a finding on blocks that deviate by far more than their noise in one place."""
    size = np.abs(fit.innovations) * np.repeat(factors, 3)[:, None]
    usual = np.sqrt(np.mean(np.minimum(size, OUTLIER_SIGMAS) ** 2, axis=1, keepdims=True))
    size = size / np.maximum(usual, 1.0)
    count = int(np.sum(size.max(axis=0) > OUTLIER_SIGMAS))
    if not 0 < count <= OUTLIER_SHARE * len(blocks):
        return []
    channel, k = np.unravel_index(int(np.argmax(size)), size.shape)
    return [
        Finding(
            "disturbed-blocks",
            f"{path}: {CHANNELS[int(channel)]} deviates by {size[channel, k]:.3g} sigma at "
            f"{blocks.time[k]:.6g} s ({count} blocks above {OUTLIER_SIGMAS:g}): a shock, or a step "
            "of the bias. Exclude this part",
            where=f"{blocks.time[k]:.6g} s",
            value=float(size[channel, k]),
            limit=OUTLIER_SIGMAS,
        )
    ]


def _step_of_bias(step: BiasStep, fit: Fit, path: str) -> Finding:
    """Return the finding on a bias that changes in the log."""
    gyro = step.channel < 3
    size, unit = (step.size / DEG_PER_HOUR, "deg/h") if gyro else (step.size, "m/s^2")
    key = "bias_instability" if gyro else "accel_bias_instability"
    cause = (
        "Probable cause: a step or warm-up; cut the log there"
        if fit.drift
        else f"Cut the log there if it is a step; set [imu] {key} if it drifts"
    )
    return Finding(
        "bias-step",
        f"{path}: the bias of {CHANNELS[step.channel]} changes by {size:.3g} {unit} near "
        f"{step.time:.6g} s ({step.sigmas:.3g} sigma of the noise). The parameters and their "
        f"sigmas are wrong. {cause}",
        where=f"{step.time:.6g} s",
        value=step.sigmas,
        limit=STEP_SIGMAS,
    )


def _over_time(fit: Fit, blocks: Blocks, path: str) -> tuple[list[Finding], BiasStep | None]:
    """Return findings on clock offsets that differ between both halves, and a step of a bias."""
    middle = 0.5 * float(blocks.time[0] + blocks.time[-1])
    late = (blocks.time >= middle).astype(np.int64)
    index = np.array([p.CLOCK_GYRO, p.CLOCK_ACCEL])
    size = p.typical_sizes(fit.problem.table.mounting_count)[index]
    at = np.searchsorted(fit.problem.free, index).clip(max=len(fit.problem.free) - 1)
    # For each clock and half: information, and information times the shift of the offset.
    sums = np.zeros((2, 2, 2))
    test = StepTest(fit, len(blocks))
    for which, rows in whitened_rows(fit, blocks):
        test.add(which, rows)
        for c, channels in enumerate((slice(0, 3), slice(3, 6))):
            column = rows[channels, :, at[c]] / size[c]
            left = fit.innovations[channels, which]
            np.add.at(sums[c, :, 0], late[which], np.sum(column**2, axis=0))
            np.add.at(sums[c, :, 1], late[which], np.sum(column * left, axis=0))
    return (
        _clock_halves(sums, fit, path),
        test.result(blocks, lambda: whitened_rows(fit, blocks)),
    )


def _clock_halves(sums: FloatArray, fit: Fit, path: str) -> list[Finding]:
    """Return findings on clock offsets that differ; sums: (2, 2, 2) per clock and half."""
    found = []
    for c, name in enumerate(("gyros", "accelerometers")):
        if (p.CLOCK_GYRO, p.CLOCK_ACCEL)[c] not in fit.problem.free or np.any(sums[c, :, 0] <= 0.0):
            continue
        shift = sums[c, :, 1] / sums[c, :, 0]
        sigma = fit.scale * float(np.sqrt(np.sum(1.0 / sums[c, :, 0])))
        difference = float(shift[1] - shift[0])
        if abs(difference) > CLOCK_SIGMAS * sigma:
            found.append(
                Finding(
                    "clock-drift",
                    f"{path}: the clock offset of the {name} changes by {difference * 1e6:.3g} us "
                    f"({abs(difference) / sigma:.2g} sigma) between both halves of the log. The "
                    "clocks of IMU and table run at different rates; synchronize them",
                    value=difference,
                    limit=CLOCK_SIGMAS * sigma,
                    unit="s",
                )
            )
    return found
