"""An observability analysis, and the estimates of the ZUPT filter, as result documents."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files.results.documents import quantity
from rotcli.files.tables import Cell, Column, Table
from rotcli.lazy import lazily
from rotcli.observe.observability import FrameObservability, Observability, Sweep
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, METRE_PER_SECOND_PER_ROOT_HOUR, PPM

with lazily():  # with a log only
    from rotcli.models import sensors
    from rotcli.observe.zupt import model

if TYPE_CHECKING:
    from rotcli.observe.zupt import ZuptResult, ZuptRun


KIND = "observability"
ATTITUDE = ("pitch", "roll", "azimuth")

# An estimate may be used if the log has reduced its sigma to this share of the initial one.
MAX_SIGMA_RATIO = 0.25
# One that the motion makes observable only in a combination: if another part of the log (a still
# segment, a second rate) has separated its terms, its sigma is reduced to this share.
MAX_SIGMA_RATIO_COMBINED = 0.1
MAX_CORRELATION = 0.9  # of two estimates that are separate
ATTITUDE_STATES = slice(3, None)  # the states that a document shows: all but the velocity


def fields(result: Observability) -> dict[str, Any]:
    """Return the document's own fields of an analysis."""
    motion = result.motion
    return {
        "model": motion.model,
        "axis": _axis(motion.axis),
        "rate": quantity(motion.rate / DEG, None, "deg/s"),
        "attitude": {
            "pitch_deg": motion.pitch / DEG,
            "roll_deg": motion.roll / DEG,
            "azimuth_deg": motion.azimuth / DEG,
        },
        "latitude_deg": motion.latitude / DEG,
        "accelerations_mps2": [list(a) for a in motion.accelerations],
        **_view(result.n),
        "rank": result.rank,
        "weak": result.weak,
        "singular_values": result.singular_values,
        "sensor_frame": _view(result.s),
        "advice": result.advice,
    }


def _axis(axis: tuple[float, float, float] | None) -> Any:
    if axis is None:
        return "none"
    for name, unit in zip("xyz", np.eye(3), strict=True):
        if np.array_equal(unit, axis):
            return name
    return list(axis)


def _view(view: FrameObservability) -> dict[str, Any]:
    return {
        "states": view.states,
        "observable": view.observable,
        "combinations": [
            {"text": c.text, "coefficients": c.coefficients} for c in view.combinations
        ],
        "unobservable": view.unobservable,
        "degrees": view.degrees,
    }


def sweep_fields(result: Sweep, states: Sequence[str]) -> dict[str, Any]:
    """Return the field `sweep` of a document."""
    return {
        "parameter": result.parameter,
        "unit": "deg/s" if result.parameter == "rate" else "deg",
        "values": result.values / DEG,
        "rank": result.rank,
        "smallest_singular_value": result.smallest,
        "weak": result.weak,
        "degrees": dict(zip(states, result.degrees.T, strict=True)),
    }


def units_of(states: Sequence[str]) -> list[tuple[str, float]]:
    """Return unit and factor of each of the filter's states."""
    known = {"v": ("m/s", 1.0), "accel": ("m/s^2", 1.0), "gyro": ("deg/h", DEG_PER_HOUR)}
    known |= {"tilt": ("deg", DEG), "azimuth": ("deg", DEG), "lever": ("m", 1.0)}
    known["column"] = ("ppm", PPM)
    return [
        known["column" if name.startswith("gyro_column") else name.split("_")[0]] for name in states
    ]


def names_of(result: "ZuptResult | ZuptRun") -> list[str]:
    """Return the names of the states; those of lever arm and axis column contain the axis."""
    s = result.settings
    names = list(s.states)
    letter = "u"
    for name, unit in zip("xyz", np.eye(3), strict=True):
        letter = name if np.array_equal(unit, s.axis) else letter
        for k, direction in zip(
            range(s.layout.LEVER_ARM.start, s.layout.LEVER_ARM.stop), s.lever_axes.T, strict=False
        ):
            if np.array_equal(direction, unit):
                names[k] = f"lever_arm_{name}"
    columns = range(s.layout.AXIS_COLUMN.start, s.layout.AXIS_COLUMN.stop)
    for k, name in zip(columns, sensors.AXIS_COLUMN_NAMES[letter], strict=False):
        names[k] = name
    return names


def filter_fields(result: "ZuptResult", analysis: Observability) -> dict[str, Any]:
    """Return the field `filter` of a document: estimates in human units."""
    e = result.estimates
    names, units = names_of(result), units_of(e.states)
    scale = np.array([factor for _, factor in units])
    values, sigma, errors = e.values / scale, e.sigma / scale, e.attitude_errors / DEG
    rms, rms_attitude = result.rms / scale, result.rms_attitude / DEG
    shown = range(3, len(names))
    low, high = result.nis_bounds
    unreliable = unreliable_estimates(result, analysis)
    return {
        "window": {"start_s": result.start, "end_s": result.end},
        "duration_s": result.end - result.start,
        "rate": quantity(result.rate / DEG, None, "deg/s"),
        "estimates": {names[k]: quantity(values[-1, k], sigma[-1, k], units[k][0]) for k in shown},
        "not_to_be_used": unreliable,
        "unreliable": unreliable,
        "rms": {
            **{f"{a}_deg": float(rms_attitude[k]) for k, a in enumerate(ATTITUDE)},
            **{names[k]: quantity(float(rms[k]), None, units[k][0]) for k in shown},
        },
        "consistency": {
            "nis_mean": result.nis,
            "nis_bounds": [low, high],
            "nis_expected": 3.0,
            "verdict": result.nis_verdict,
        },
        "settings": _settings_fields(result),
        "history": {
            "time_s": e.time,
            **{f"{a}_error_deg": errors[:, k] for k, a in enumerate(ATTITUDE)},
            **{
                name: {"unit": units[k][0], "value": values[:, k], "sigma": sigma[:, k]}
                for k, name in enumerate(names)
                if k > 2
            },
        },
    }


def _settings_fields(result: "ZuptResult") -> dict[str, Any]:
    """Return the settings of the filter in human units."""
    s = result.settings
    n, i = s.noise, s.initial
    return {
        "update_rate_hz": 1.0 / result.update_interval,
        "velocity_sigma": quantity(s.velocity_sigma, None, "m/s"),
        "velocity_sigma_estimated": result.measured_noise,
        "slaved_azimuth": s.slave_azimuth,
        "smoothed": s.smooth,
        "calibrated": result.calibrated,
        "lever_arm_m": list(s.lever_arm),
        "angle_random_walk": quantity(n.angle_random_walk / DEG_PER_ROOT_HOUR, None, "deg/sqrt(h)"),
        "velocity_random_walk": quantity(
            n.velocity_random_walk / METRE_PER_SECOND_PER_ROOT_HOUR, None, "m/s/sqrt(h)"
        ),
        "gyro_wander": quantity(n.gyro_markov_sigma / DEG_PER_HOUR, None, "deg/h"),
        "gyro_wander_time": quantity(n.gyro_correlation_time, None, "s"),
        "accel_wander": quantity(n.accel_markov_sigma, None, "m/s^2"),
        "accel_wander_time": quantity(n.accel_correlation_time, None, "s"),
        "initial_sigma": {
            "velocity": quantity(i.velocity, None, "m/s"),
            "tilt": quantity(i.tilt / DEG, None, "deg"),
            "azimuth": quantity(i.azimuth / DEG, None, "deg"),
            "accel": quantity(i.accel, None, "m/s^2"),
            "gyro": quantity(i.gyro / DEG_PER_HOUR, None, "deg/h"),
            "scale": quantity(i.scale / PPM, None, "ppm"),
        },
    }


def unreliable_estimates(result: "ZuptResult", analysis: Observability) -> dict[str, str]:
    """Return the estimates that must not be used, each with the reason.

    analysis: of the motion, in the simplified model.
    """
    names = names_of(result)
    if result.contradiction is not None:
        return dict.fromkeys(names[ATTITUDE_STATES], result.contradiction)
    if result.nis_verdict == "inconsistent":
        reason = (
            f"the innovations contradict the sigmas: mean NIS {result.nis:.3g}, "
            f"limit {result.nis_bounds[1]:.3g}"
        )
        return dict.fromkeys(names[ATTITUDE_STATES], reason)
    if result.prior_violations:
        return dict.fromkeys(names[ATTITUDE_STATES], result.prior_violations[0])
    return _unobservable_estimates(result, analysis.s, names)


def _unobservable_estimates(
    result: "ZuptResult", frame: FrameObservability, names: list[str]
) -> dict[str, str]:
    """Return the estimates that the motion or the log does not determine, with the reason."""
    units = units_of(result.estimates.states)
    sigma = np.sqrt(np.diag(result.estimates.P))
    ratio = sigma / result.settings.initial_sigma
    analysed = {"tilt_east": "eps_E", "tilt_north": "eps_N", "azimuth": "eps_U"}
    correlated = _correlated_pairs(result, names)
    reasons: dict[str, str] = {}
    for k, name in list(enumerate(names))[ATTITUDE_STATES]:
        state = analysed.get(name, name)
        unit, factor = units[k]
        now = f"sigma {sigma[k] / factor:.3g} {unit}"
        joint = [c.text for c in frame.combinations if state in c.coefficients]
        if name == "azimuth":
            reasons[name] = f"unobservable: this is the initial azimuth ({now})"
        elif state in frame.unobservable:
            reasons[name] = f"unobservable with this motion ({now})"
        elif joint and ratio[k] > MAX_SIGMA_RATIO_COMBINED:
            reasons[name] = f"observable only in the combination {joint[0]} ({now})"
        elif ratio[k] > MAX_SIGMA_RATIO:
            initial = f"{result.settings.initial_sigma[k] / factor:.3g}"
            reasons[name] = f"the log hardly improves it: {now}, initially {initial}"
            if state in correlated:
                reasons[name] += f"; a single rate does not separate it from {correlated[state]}"
    return reasons


def _correlated_pairs(result: "ZuptResult", names: Sequence[str]) -> dict[str, str]:
    """Return each gyro bias and element of the axis column that only their sum determines."""
    P, column = result.estimates.P, result.settings.layout.AXIS_COLUMN
    pairs: dict[str, str] = {}
    biases, elements = (range(g.start, g.stop) for g in (model.GYRO_BIAS, column))
    for i, j in zip(biases, elements, strict=False):
        if abs(P[i, j]) > MAX_CORRELATION * np.sqrt(P[i, i] * P[j, j]):
            pairs |= {names[i]: names[j], names[j]: names[i]}
    return pairs


def table(doc: Mapping[str, Any]) -> Table:
    """Return the estimates of a log, else the states of a motion or of a sweep."""
    turning = doc["axis"] != "none" and doc["rate"]["value"]
    axis = doc["axis"] if isinstance(doc["axis"], str) else "an oblique axis"
    motion = f"about {axis} at {doc['rate']['value']:.6g} deg/s" if turning else "still"
    rank = f"rank {doc['rank']} of 12{', weak' if doc['weak'] else ''}"
    if "filter" in doc:
        f = doc["filter"]
        c = f["consistency"]
        unreliable = f["not_to_be_used"]
        return Table(
            title=f"ZUPT filter estimates, {motion} ({rank})",
            columns=(
                Column("estimate"),
                Column("value", ".5g"),
                Column("sigma", ".3g"),
                Column("unit"),
                Column("use"),
            ),
            rows=[
                (
                    name,
                    q["value"],
                    q["sigma"],
                    q["unit"],
                    f"no: {unreliable[name]}" if name in unreliable else "yes",
                )
                for name, q in f["estimates"].items()
            ],
            note=f"Innovations: mean NIS {c['nis_mean']:.3g}, 95 % bounds {c['nis_bounds'][0]:.3g} "
            f"to {c['nis_bounds'][1]:.3g}: the sigmas are {c['verdict']}.\n{doc['advice']}",
        )
    if "sweep" in doc:
        return _sweep_table(doc, motion)
    rows: list[tuple[Cell, ...]] = []
    for view in (doc, doc["sensor_frame"]):
        for state in view["states"]:
            if view is doc or state not in doc["states"]:
                joint = [c["text"] for c in view["combinations"] if state in c["coefficients"]]
                alone = "no" if state in view["unobservable"] else "yes"
                cell = f"only in {' ; '.join(joint)}" if joint else alone
                rows.append((state, view["degrees"][state], cell))
    return Table(
        title=f"Observability, {motion}, {doc['model']} model: {rank}",
        columns=(Column("state"), Column("degree", ".3f"), Column("observable")),
        rows=rows,
        note="g: gravity; w: magnitude of the table rate. dv velocity error, eps "
        f"attitude error, gamma accelerometer bias, d gyro bias.\n{doc['advice']}",
    )


def _sweep_table(doc: Mapping[str, Any], motion: str) -> Table:
    s = doc["sweep"]
    states = list(s["degrees"])
    return Table(
        title=f"Observability along {s['parameter']}, {motion}, {doc['model']} model",
        columns=(
            Column(f"{s['parameter']}, {s['unit']}", ".6g"),
            Column("rank", "d"),
            Column("weak"),
            *(Column(state, ".2f") for state in states[3:]),
        ),
        rows=[
            (
                value,
                s["rank"][k],
                "weak" if s["weak"][k] else "",
                *(s["degrees"][state][k] for state in states[3:]),
            )
            for k, value in enumerate(s["values"])
        ],
        note=f"Degree of each state: 0 = unobservable, 1 = fully observable.\n{doc['advice']}",
    )
