"""User-facing errors: one line that says what is wrong and how to fix it."""

import sys


class HandcalError(Exception):
    """Base class of all user-facing errors.

    Parameters
    ----------
    what : str
        What is wrong.
    advice : str
        What to do about it; may be empty. The error's text is both, unchanged.
    """

    def __init__(self, what: str, advice: str = "") -> None:
        super().__init__(what, advice)
        self.what = what
        self.advice = advice

    def __str__(self) -> str:
        return f"{self.what}; {self.advice}" if self.advice else self.what


class CameraError(HandcalError):
    """The camera is missing, failed, or cannot do what was asked."""


class CameraTimeoutError(CameraError):
    """No frame arrived in time; the next read may succeed."""


class CameraEndError(CameraError):
    """A recording has no more frames."""


class HandError(HandcalError):
    """No hand could be segmented in a frame; the text says why."""


class NoFrameError(HandError):
    """No frame is of the time at which a hand is looked for."""


class OutOfViewError(HandError):
    """The camera sees only a part of the hand, which must be held elsewhere."""


class LinkError(HandcalError):
    """The headset could not be reached, or did not acknowledge."""


class FileError(HandcalError):
    """A file is missing, malformed, too large or of an unknown version."""


class InUseError(FileError):
    """A program, this one if `is_here`, holds a folder or a file."""

    def __init__(self, what: str, advice: str = "", *, is_here: bool) -> None:
        super().__init__(what, advice)
        self.is_here = is_here


class PoseError(HandcalError):
    """The headset's pose at a time is unknown; the text says why."""


class PosePendingError(PoseError):
    """The headset's pose at a time has not arrived yet; the next request may succeed."""


class CancelledError(HandcalError):
    """A long task was cancelled on request; nothing has changed."""


def extra_advice(extra: str) -> str:
    """Return the advice to install an extra, which depends on how handcal was installed."""
    if not getattr(sys, "frozen", False):
        return f"pip install 'handcal[{extra}]'"
    if extra == "3d":
        return "install the package handcal-open3d in place of handcal"
    return "it is not in the Debian package: install handcal's wheel (docs/platforms.md)"
