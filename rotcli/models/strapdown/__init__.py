"""Strapdown mechanization of IMU logs, many samples at once.

Three observations make a mechanization without a loop over samples:

- Attitude against inertial space needs neither position nor velocity. It is the running product
  of the rotations of single samples (`attitude`).
- Specific force in inertial axes is smooth even if the sensor spins, so velocity and position
  are weighted sums of it (`translation`, weights from `quadrature`).
- Only gravity depends on position, and it changes slowly. It is evaluated once per cell of
  samples; a few fixed-point sweeps settle it (`translation`, `local_gravity`).

`cells` describes the layout of the arrays, `geography` computes latitude, longitude, height,
velocity and attitude in local axes. docs/explanation/strapdown.md has the derivation.
"""

from rotcli.models.strapdown.mechanization import (
    InitialState,
    Mechanization,
    Trajectory,
    mechanize_log,
)

__all__ = ["InitialState", "Mechanization", "Trajectory", "mechanize_log"]
