"""handcal: calibrate an optical see-through headset with the wearer's bare hand."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handcal.display import update_matrix
    from handcal.register.guard import rotation_between
    from handcal.register.solve import solve_eye_shift

__all__ = ["rotation_between", "solve_eye_shift", "update_matrix"]

_HOMES = {
    "rotation_between": "handcal.register.guard",
    "solve_eye_shift": "handcal.register.solve",
    "update_matrix": "handcal.display",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for only then: scipy alone takes longer than a whole command line."""
    if name not in _HOMES:
        raise AttributeError(f"module 'handcal' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
