"""A plan as a result document, as tables, and as a list of steps for the operator."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rotcli.files.results.documents import quantity
from rotcli.files.results.groups import Source
from rotcli.files.tables import Cell, Column, Table
from rotcli.models.triad import parameters as p
from rotcli.models.triad.motion import Go, Hold, MotionBuilder, Mount, Step
from rotcli.plan.estimate import Assessed, Plan
from rotcli.units import DEG

KIND = "plan"
_AXES = {1: ("axis",), 2: ("outer axis", "inner axis"), 3: ("outer", "middle", "inner axis")}
# Rows of the comparison: name, groups of parameters, how they are summed up.
_ROWS = (
    ("gyro matrix N, RMS", "N", None),
    ("gyro bias", "d", None),
    ("g-sensitivity", "G", None),
    ("gyro asymmetry", "Ag", None),
    ("accelerometer installation, RMS", "M", "off"),
    ("accelerometer scale factor", "M", "diagonal"),
    ("accelerometer bias", "b", None),
    ("second-order term", "K2", None),
    ("accelerometer asymmetry", "Aa", None),
    ("lever", "R", None),
    ("clock of the accelerometers", "tau", "second"),
    ("clock of the gyros", "tau", "first"),
)


def fields(plan: Plan) -> dict[str, Any]:
    """Return the document's fields."""
    return {
        "axes": plan.table.axes,
        "convention": plan.convention,
        "duration_s": plan.assessed.duration,
        "spin_share": plan.spin_share,
        "plan": _assessed(plan, plan.assessed),
        "others": {a.name: _assessed(plan, a) for a in plan.others},
        "steps": [step_text(step, plan) for step in plan.steps],
        "warnings": [],
    }


def _assessed(plan: Plan, one: Assessed) -> dict[str, Any]:
    mountings = plan.problem.table.mounting_count
    names, unit = p.names(mountings), p.unit_names(mountings)
    factor = p.unit_factors(mountings)
    return {
        "duration_s": one.duration,
        "d_efficiency_of_plan": plan.assessed.efficiency_over(one),
        "sigma": {
            names[k]: quantity(float(s / factor[k]), None, unit[k])
            for k, s in zip(plan.problem.free, one.sigma, strict=True)
        },
    }


def headline(doc: Mapping[str, Any]) -> str:
    """Return a plan in one line."""
    over = ", ".join(
        f"{name} {one['d_efficiency_of_plan']:.2f}" for name, one in doc["others"].items()
    )
    return f"plan of {doc['duration_s']:.0f} s; D-efficiency over {over}"


def _figure(sigma: Mapping[str, Any], group: str, part: str | None) -> tuple[float, str] | None:
    """Return the RMS of the sigmas of a group and its unit, None where it is not estimated."""
    names = p.GROUPS[group].names
    chosen = [
        name
        for k, name in enumerate(names)
        if (part is None)
        or (part == "off" and k % 4)
        or (part == "diagonal" and not k % 4)
        or (part == "first" and k == 0)
        or (part == "second" and k == 1)
    ]
    # Elements that the convention makes zero have no sigma.
    values = [s for s in (sigma[name]["value"] for name in chosen if name in sigma) if s > 0.0]
    return (float(np.sqrt(np.mean(np.square(values)))), p.GROUPS[group].unit) if values else None


def comparison_table(doc: Mapping[str, Any]) -> Table:
    """Return the predicted sigmas of the plan and of the standard sequences of the same time."""
    everything = {"plan": doc["plan"], **doc["others"]}
    rows: list[tuple[Cell, ...]] = []
    for label, group, part in _ROWS:
        found = [_figure(one["sigma"], group, part) for one in everything.values()]
        if found[0] is not None:
            rows.append((f"{label} ({found[0][1]})", *(f and f[0] for f in found)))
    efficiency = [one["d_efficiency_of_plan"] for one in everything.values()]
    rows.append(("D-efficiency of the plan", *efficiency))
    rows.append(("duration (s)", *(one["duration_s"] for one in everything.values())))
    columns = (Column("1-sigma"), *(Column(name, ".3g") for name in everything))
    note = (
        f"White noise of the rig, {doc['convention']} convention. {doc['spin_share']:.0%} of the "
        "plan's time are spins. Standard sequences have their still times and turns scaled to the "
        "same duration."
    )
    return Table("Predicted sigmas of the plan and of standard sequences", columns, rows, note)


def plan_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the tables of several plans for a report."""
    return [comparison_table(source.doc) for source in sources]


def step_text(step: Step, plan: Plan) -> str:
    """Return a step for the operator."""
    names = _AXES[plan.table.axes]
    if isinstance(step, Mount):
        return f"Mount the IMU in mounting {step.mounting + 1} ({_mounting_text(step, plan)})"
    if isinstance(step, Go):
        parts = [f"{n} {a / DEG + 0.0:.3f}".rstrip("0").rstrip(".") + " deg"
                 for n, a in zip(names, step.attitude, strict=True)]  # fmt: skip
        return "Go to " + ", ".join(parts).replace("axis ", "", int(len(names) == 1))
    if isinstance(step, Hold):
        return f"Hold still for {step.duration:g} s"
    both = ", then the same backwards" if step.both else ""
    which = "table" if len(names) == 1 else f"{names[step.axis].removesuffix(' axis')} axis"
    return f"Turn the {which} at {step.rate / DEG:g} deg/s, {step.turns:g} turns{both}"


def _mounting_text(step: Mount, plan: Plan) -> str:
    """Return where the sensor axes point at zero angles of the table."""
    C_ms = plan.problem.table.mountings[step.mounting]
    parts = []
    for sensor, column in zip("xyz", C_ms.T, strict=True):
        k = int(np.argmax(np.abs(column)))
        parts.append(f"sensor {sensor} along {'-' if column[k] < 0.0 else ''}{'xyz'[k]}")
    return ", ".join(parts) + " of the base"


def step_list(plan: Plan) -> str:
    """Return the numbered steps as Markdown, with the time at which each begins."""
    builder = MotionBuilder(plan.table.axes, plan.table.acceleration, plan.table.slew_rate)
    lines = [
        "# Steps of the calibration",
        "",
        f"{plan.assessed.duration / 60.0:.1f} min, ramps and slews at "
        f"{plan.table.acceleration / DEG:g} deg/s^2, slews at most {plan.table.slew_rate / DEG:g} "
        "deg/s. Log IMU and table all the time; slews and ramps are data.",
        "",
    ]
    for number, step in enumerate(plan.steps, start=1):
        begin = builder.motion().duration if builder.has_motion else 0.0
        lines.append(f"{number}. {begin:.0f} s: {step_text(step, plan)}.")
        builder.play([step])
    return "\n".join(lines) + "\n"
