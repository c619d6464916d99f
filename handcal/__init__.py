"""handcal: calibrate an optical see-through headset with the wearer's bare hand."""

from handcal.display import update_matrix
from handcal.register.guard import rotation_between
from handcal.register.solve import solve_eye_shift

__all__ = ["rotation_between", "solve_eye_shift", "update_matrix"]
