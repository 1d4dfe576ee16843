"""Predicted sigmas of a scale factor test: the order of the rates against alternating signs."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.files.results.documents import document, quantity
from rotcli.files.results.groups import Source
from rotcli.files.results.result import Result
from rotcli.files.tables import Cell, Column, Table
from rotcli.models.sensors import NoiseFigures
from rotcli.scale.prediction import CHANGE, DURATION, DesignSigmas, alternating, design_sigmas
from rotcli.units import DEG, DEG_PER_HOUR, PPM, FloatArray

KIND = "scale-design"


@dataclass(frozen=True, eq=False)
class ScaleDesign(Result):
    """Predicted sigmas of a test, as planned and in the recommended order."""

    planned: DesignSigmas
    recommended: DesignSigmas

    kind: ClassVar[str] = KIND

    def tables(self) -> list[Table]:
        """Return the table of both orders."""
        return [design_table(self.document)]

    def one_line_summary(self) -> str:
        """Return the sigma of the scale factor in both orders."""
        return (
            f"sigma of the scale factor {self.planned.scale / PPM:.1f} ppm, with alternating "
            f"signs {self.recommended.scale / PPM:.1f} ppm"
        )


def scale_design(
    rates: FloatArray,
    figures: NoiseFigures,
    *,
    full_scale: float | None = None,
    duration: float = DURATION,
    change: float = CHANGE,
    rig: Mapping[str, Any] | None = None,
) -> ScaleDesign:
    """Return the sigmas of a test at rates (k,), rad/s, in this order and with alternating signs.

    figures: noise of the gyro (SI). full_scale: rad/s, default the largest rate. duration: s per
    segment; change: s between two. Raises ValueError if there is one rate only.
    """
    scale = full_scale or float(np.max(np.abs(rates)))
    best = alternating(rates)
    planned = design_sigmas(rates, figures, scale, duration, change)
    recommended = design_sigmas(best, figures, scale, duration, change)
    fields = {
        "full_scale": quantity(scale / DEG, None, "deg/s"),
        "segment_s": duration,
        "change_s": change,
        "planned": _entry(rates, planned),
        "recommended": _entry(best, recommended),
        "warnings": [],
    }
    return ScaleDesign(document(KIND, [], rig or {}, fields), planned, recommended)


def _entry(rates: FloatArray, sigmas: DesignSigmas) -> dict[str, Any]:
    """Return one order as its document contains it."""

    def optional(value: float | None, unit: float) -> float | None:
        return None if value is None else value / unit

    return {
        "rates_dps": rates / DEG,
        "duration_s": sigmas.total,
        "scale_ppm": sigmas.scale / PPM,
        "bias_dph": sigmas.bias / DEG_PER_HOUR,
        "bias_own_span_dph": sigmas.bias_own / DEG_PER_HOUR,
        "asymmetry_ppm": optional(sigmas.asymmetry, PPM),
        "hysteresis_dph": optional(sigmas.hysteresis, DEG_PER_HOUR),
        "nonlinearity_limit_ppm": optional(sigmas.nonlinearity_limit, PPM),
        "response_ratio": sigmas.response_ratio,
        "coefficients_ppm": {
            name: [s / PPM for s in values] for name, values in sigmas.coefficients.items()
        },
    }


def design_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the tables of several designs, for a report."""
    return [design_table(source.doc) for source in sources]


_ROWS = (
    ("scale factor", "scale_ppm", "ppm"),
    ("bias, next 300 s", "bias_dph", "deg/h"),
    ("bias, mean of the test", "bias_own_span_dph", "deg/h"),
    ("asymmetry", "asymmetry_ppm", "ppm"),
    ("nonlinearity, 95 % limit of a line", "nonlinearity_limit_ppm", "ppm of full scale"),
    ("hysteresis", "hysteresis_dph", "deg/h"),
    ("response ratio, smallest rate", "response_ratio", "1"),
    ("duration", "duration_s", "s"),
)


def design_table(doc: Mapping[str, Any]) -> Table:
    """Return the table of a design document."""
    columns = (
        Column("sigma of"),
        Column("planned", ".4g"),
        Column("alternating", ".4g"),
        Column("unit"),
    )
    rows: list[tuple[Cell, ...]] = [
        (name, doc["planned"][key], doc["recommended"][key], unit) for name, key, unit in _ROWS
    ]
    order = ", ".join(f"{rate:g}" for rate in doc["recommended"]["rates_dps"])
    note = (
        f"Segments of {doc['segment_s']:g} s, {doc['change_s']:g} s apart. Alternate the signs: "
        f"neighbours cancel drift; order: {order} deg/s. Hysteresis needs sweeps up and down."
    )
    return Table("Predicted sigmas of a scale factor test", columns, rows, note)
