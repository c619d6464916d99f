"""handcal: calibrate an optical see-through headset with the wearer's bare hand.

>>> import handcal
>>> session = handcal.example_session()
>>> results = handcal.solve(session)
>>> print(results.eyes["left"])
φ = (+4.20 ± 1.14, -4.39 ± 0.96, +0.91 ± 2.54) mm; rms 1.55 mm, 97 % inliers, converged

Lengths are in metres, angles in radians, axes OpenCV's; `handcal.core.types` names the frames.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handcal.calibration.solve_again import solve
    from handcal.camera.images import read_frame
    from handcal.core.conventions import EyeCamera, Fov, Pose, to_opengl, to_openxr, to_unity
    from handcal.core.display import projections, update_matrix
    from handcal.core.errors import HandcalError, HandError
    from handcal.core.types import (
        Alignment,
        EyeDistance,
        EyeShift,
        Frame,
        HandCloud,
        Intrinsics,
        Rig,
    )
    from handcal.export.clouds import read_cloud
    from handcal.hand.shipped import segment
    from handcal.register.guard import rotation_between
    from handcal.register.results import Results
    from handcal.register.solve import solve_eye_shift
    from handcal.rig.example import example_rig
    from handcal.rig.rig_file import read_rig, write_rig
    from handcal.session.record import SessionRecord
    from handcal.session.session import example_session, open_session
    from handcal.sim.camera import simulated_frame

    __version__: str

__all__ = [
    "Alignment",
    "EyeCamera",
    "EyeDistance",
    "EyeShift",
    "Fov",
    "Frame",
    "HandCloud",
    "HandError",
    "HandcalError",
    "Intrinsics",
    "Pose",
    "Results",
    "Rig",
    "SessionRecord",
    "__version__",
    "example_rig",
    "example_session",
    "open_session",
    "projections",
    "read_cloud",
    "read_frame",
    "read_rig",
    "rotation_between",
    "segment",
    "simulated_frame",
    "solve",
    "solve_eye_shift",
    "to_opengl",
    "to_openxr",
    "to_unity",
    "update_matrix",
    "write_rig",
]

_HOMES = {
    "calibration.solve_again": ("solve",),
    "camera.images": ("read_frame",),
    "core.conventions": ("EyeCamera", "Fov", "Pose", "to_opengl", "to_openxr", "to_unity"),
    "core.display": ("projections", "update_matrix"),
    "core.errors": ("HandError", "HandcalError"),
    "core.types": (
        "Alignment",
        "EyeDistance",
        "EyeShift",
        "Frame",
        "HandCloud",
        "Intrinsics",
        "Rig",
    ),
    "export.clouds": ("read_cloud",),
    "hand.shipped": ("segment",),
    "register.guard": ("rotation_between",),
    "register.results": ("Results",),
    "register.solve": ("solve_eye_shift",),
    "rig.example": ("example_rig",),
    "rig.rig_file": ("read_rig", "write_rig"),
    "session.record": ("SessionRecord",),
    "session.session": ("example_session", "open_session"),
    "sim.camera": ("simulated_frame",),
}
_HOME_OF = {name: f"handcal.{home}" for home, names in _HOMES.items() for name in names}


if not TYPE_CHECKING:  # a type checker would take any name for one of Any

    def __getattr__(name: str) -> Any:
        """Import a name when it is first used: scipy alone takes longer than a command line."""
        if name == "__version__":
            value = import_module("importlib.metadata").version("handcal")
        elif name in _HOME_OF:
            value = getattr(import_module(_HOME_OF[name]), name)
        else:
            raise AttributeError(f"module 'handcal' has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """Return the public names: what completion offers."""
    return __all__
