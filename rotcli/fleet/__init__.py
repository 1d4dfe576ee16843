"""Many results of many devices: repeatability, variance components, outliers, charts, yield.

The mathematics works on arrays: `nested` sorts rows by unit and day, `components` estimates the
variances, and `outliers`, `charts`, `aging` and `yields` use them. In this folder a *unit* is one
device (a member of the fleet), and a *turn-on* is one result.
"""
