"""Summaries of results in sentences, for kinds whose own headline does not say what was found."""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli.files.captions import motion
from rotcli.files.results.groups import Source
from rotcli.units import digits

_COEFFICIENTS = {
    "random_walk": {"gyro": "angle random walk", "accel": "velocity random walk"},
    "bias_instability": {"gyro": "bias instability", "accel": "bias instability"},
    "rate_random_walk": {"gyro": "rate random walk", "accel": "acceleration random walk"},
}
_SENSORS = {"gyro": "gyros", "accel": "accelerometers"}


def allan_sentences(sources: Sequence[Source]) -> list[str]:
    """Return the noise of each IMU: the range of each coefficient over the axes of a sensor."""
    found = []
    for source in sorted(sources, key=lambda s: (s.imu.casefold(), s.path)):
        parts = []
        for sensor, plural in _SENSORS.items():
            axes = [name for name in source.section("axes") if name.startswith(f"{sensor}_")]
            texts = [
                _range(source, axes, name, words[sensor]) for name, words in _COEFFICIENTS.items()
            ]
            if known := [text for text in texts if text]:
                parts.append(f"{plural} {', '.join(known)}")
        found.append(f"{source.imu}: noise: {'; '.join(parts) or 'no significant coefficient'}.")
    return found


def _range(source: Source, axes: Sequence[str], coefficient: str, words: str) -> str:
    values, unit = [], ""
    for axis in axes:
        place = ("axes", axis, "coefficients", coefficient)
        value = source.number_or_none(*place, "value")
        if value is not None:
            values.append(value)
            unit = str(source.section(*place).get("unit", ""))
    if not values:
        return ""
    low, high = digits(min(values), 2), digits(max(values), 2)
    return f"{words} {low if low == high else f'{low} to {high}'} {unit}"


def budget_headline(doc: Mapping[str, Any]) -> str:
    """Return the recommendation of an error budget."""
    return str(doc["recommendation"])


def observability_headline(doc: Mapping[str, Any]) -> str:
    """Return what a motion makes observable, and what a filter found with it."""
    weak = ", weakly" if doc["weak"] else ""
    text = f"{motion(doc)}: {doc['rank']} of 12 states observable{weak}"
    found = doc.get("filter")
    if not found:
        return f"{text}. {doc['advice']}"
    rms = found["rms"]
    errors = ", ".join(
        f"{name} {digits(rms[f'{name}_deg'], 2)}" for name in ("roll", "pitch", "azimuth")
    )
    unreliable = found["not_to_be_used"]
    reliable = [name.replace("_", " ") for name in found["estimates"] if name not in unreliable]
    return (
        f"{text}; RMS attitude errors {errors} deg over {found['duration_s']:.0f} s; reliable: "
        f"{', '.join(reliable) or 'no estimate'}; sigmas {found['consistency']['verdict']}."
    )


def srins_sentences(sources: Sequence[Source]) -> list[str]:
    """Return of each voyage the axial drift with sigma and error, and when it had converged."""
    found = []
    for source in sources:
        doc = source.doc
        drift = doc["estimates"]["gyro_bias_z"]
        hours = (doc["filter"]["end_s"] - doc["filter"]["start_s"]) / 3600.0
        text = (
            f"{source.path} ({doc['mode']}): drift along the axis "
            f"{digits(drift['value'], 3)} deg/h after {hours:.3g} h, sigma {drift['sigma']:.2g}"
        )
        true = (doc.get("truth") or {}).get("gyro_bias_z")
        if true is not None:
            text += f", error {(drift['value'] - true) / drift['sigma']:.1f} sigma"
        convergence = doc["convergence"]
        reached = [
            (fraction, time)
            for fraction, time in zip(convergence["fractions"], convergence["hours"], strict=True)
            if time is not None
        ]
        if reached:
            fraction, hours = reached[-1]
            drift_dph = convergence["stated_drift_dph"]
            text += f"; sigma below {100.0 * fraction:.0f} % of {drift_dph:g} deg/h"
            text += f" after {hours:.3g} h"
        sound = "consistent" if doc["consistency"]["gnss"]["sound"] else "not consistent"
        found.append(f"{text}; GNSS innovations {sound}.")
    return found


def srins_observability_headline(doc: Mapping[str, Any]) -> str:
    """Return rank and degrees of observability of the schemes for the drift along the axis."""
    degrees = {kind: values["gyro_bias_z"] for kind, values in doc["degrees"].items()}
    shown = ", ".join(f"{kind} {value:.3f}" for kind, value in degrees.items())
    return (
        f"true rank {doc['true_rank']} of {len(doc['states'])}; degree of observability of the "
        f"drift along the axis after {doc['hours']:g} h: {shown}."
    )
