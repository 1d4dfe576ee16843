"""rotcli: turntable logs of an IMU to noise, calibration, navigation and observability results.

`read_imu`, `read_table`, `read_rig`, `allan`, `calibrate`, `scale`, `thermal`, `warm_up`,
`triad`, `plan`, `navigate`, `observe` and `simulate` do what the commands do; see `rotcli.public`.

Units: inside the program everything is SI and radians, and names have no unit (`w_ib_b`,
`latitude`, `time`). At a door of the program (a log column, a rig key, a command-line option, a
JSON key) the unit is always named (`gyro_x [deg/s]`, `rate_dps`, `height_m`).

Frames: `n` navigation (East-North-Up), `b` body (x right, y forward, z up), `s` sensor (turns with
the table), `i` inertial, `e` Earth-fixed. `C_ab` transforms a vector from b to a, so letters
cancel: `v_n = C_nb @ v_b`, `C_ns = C_nb @ C_bs`. `w_ib_b` is the rate of b relative to i, resolved
in b.
"""

import sys
from collections.abc import Callable
from functools import update_wrapper
from importlib import import_module
from types import ModuleType

from rotcli.version import __version__

TYPE_CHECKING = False  # `typing` is not needed for that
if TYPE_CHECKING:
    from rotcli.public import allan as allan
    from rotcli.public import calibrate as calibrate
    from rotcli.public import navigate as navigate
    from rotcli.public import observe as observe
    from rotcli.public import plan as plan
    from rotcli.public import read_imu as read_imu
    from rotcli.public import read_rig as read_rig
    from rotcli.public import read_table as read_table
    from rotcli.public import scale as scale
    from rotcli.public import simulate as simulate
    from rotcli.public import thermal as thermal
    from rotcli.public import triad as triad
    from rotcli.public import warm_up as warm_up

__all__ = [
    "__version__",
    "allan",
    "calibrate",
    "navigate",
    "observe",
    "plan",
    "read_imu",
    "read_rig",
    "read_table",
    "scale",
    "simulate",
    "thermal",
    "triad",
    "warm_up",
]


class _Function:
    """A public function that has the name of a subpackage (`rotcli.allan`).

    Its attributes are those of the subpackage, so that `import rotcli.allan.api as api` works.
    """

    def __init__(self, function: Callable[..., object], package: str) -> None:
        self._package = package
        update_wrapper(self, function)

    def __call__(self, *args: object, **options: object) -> object:
        function: Callable[..., object] = self.__dict__["__wrapped__"]
        return function(*args, **options)

    def __getattr__(self, name: str) -> object:
        return getattr(sys.modules[self._package], name)


class _Package(ModuleType):
    """The package with its public functions, imported on first use.

    The import system sets the attribute `calibrate` when it loads the subpackage of that name; this
    is ignored, so that the name is the function at all times.
    """

    def __getattr__(self, name: str) -> object:
        if name not in __all__:
            raise AttributeError(f"module 'rotcli' has no attribute {name!r}")
        function = getattr(import_module("rotcli.public"), name)
        package = f"rotcli.{name}"
        return _Function(function, package) if package in sys.modules else function

    def __setattr__(self, name: str, value: object) -> None:
        if name in __all__ and isinstance(value, ModuleType):
            return
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *__all__})


sys.modules[__name__].__class__ = _Package
