"""The fixed base of a navigation: site, gravity and attitude from the rig and the still segment."""

from dataclasses import replace

from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.logs.record import ImuSource, TableLog
from rotcli.models import earth, rotation
from rotcli.models.base import FixedBase, level
from rotcli.rig.rig import Rig
from rotcli.run.checks import judge
from rotcli.run.evidence.gravity import check_gravity
from rotcli.run.recording import NavigationRun, navigation_run
from rotcli.units import DEG


@dataclass(frozen=True, eq=False)
class Place:
    """Position, gravity and attitude of the fixed base: rad, rad, m, m/s^2, rad."""

    latitude: float
    longitude: float
    height: float
    gravity: float
    pitch: float
    roll: float
    azimuth: float

    @property
    def base(self) -> FixedBase:
        """The fixed base, with Earth rate and specific force at rest."""
        C_nb = rotation.attitude_matrix(self.pitch, self.roll, self.azimuth)
        return FixedBase(self.latitude, self.gravity, C_nb)


def prepare(
    imu: ImuSource, table: TableLog | None, rig: Rig, *, need_static: bool
) -> tuple[NavigationRun, Place]:
    """Find the segments of a log and its fixed base; without a table log the table is still.

    Pitch and roll that the rig omits are levelled from the still segment; an omitted azimuth is
    assumed north, with a warning. Raises RigError without a site, LogError if the logs do not
    contain the segments or the table turns in another sense than the rig has.
    """
    unlevelled = rig.attitude.pitch is None or rig.attitude.roll is None
    run = navigation_run(imu, table, rig, need_static=need_static or unlevelled)
    place, assumed = _place(rig, run)
    first = next(iter(imu.chunks(run.window)))
    f_b = rotation.sum_rotated(run.axis, run.angle_at(first.time), first.accel) / first.samples
    found = judge("navigate", check_gravity(imu, f_b, place.base.specific_force))
    log_warnings = (*run.log_warnings, *assumed)
    return replace(run, log_warnings=log_warnings, findings=(*run.findings, *found)), place


def _place(rig: Rig, run: NavigationRun) -> tuple[Place, tuple[str, ...]]:
    """Return the base: the rig's site and attitude, what it leaves out levelled or assumed."""
    name = rig.path or "no rig.toml"
    if rig.site is None:
        raise RigError(
            f"{name}: [site] latitude: missing; navigation needs the place of the table: write "
            "a rig.toml next to the log, or name another rig",
            code="site-missing",
        )
    warnings = []
    pitch, roll, azimuth = rig.attitude.pitch, rig.attitude.roll, rig.attitude.azimuth
    if run.static is not None and (pitch is None or roll is None):
        levelled = level(
            run.mean(run.static, lambda log, a: rotation.sum_rotated(run.axis, a, log.accel))
        )
        pitch = levelled[0] if pitch is None else pitch
        roll = levelled[1] if roll is None else roll
        warnings.append(
            f"{name}: [attitude] leaves out pitch or roll: levelled by the accelerometers to "
            f"pitch {pitch / DEG:.3f} deg, roll {roll / DEG:.3f} deg"
        )
    if azimuth is None:
        warnings.append(
            f"{name}: [attitude] leaves out azimuth: taken as 0 (north), so up to 15 deg/h of "
            "Earth rate may be taken out along the wrong axes; add it"
        )
    if abs(pitch or 0.0) > rotation.MAX_EULER_PITCH:
        warnings.append(
            f"{name}: [attitude] pitch is {(pitch or 0.0) / DEG:.4g} deg, where roll and azimuth "
            "are not defined. The attitude errors are a rotation vector along right (pitch), "
            "forward (roll) and down (azimuth)"
        )
    site = rig.site
    gravity = earth.gravity_at(site.latitude, site.height, site.gravity)
    attitude = (pitch or 0.0, roll or 0.0, azimuth or 0.0)
    return Place(site.latitude, site.longitude, site.height, gravity, *attitude), tuple(warnings)
