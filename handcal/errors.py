"""Errors that a person can do something about: one line that says what is wrong and what to do."""


class HandcalError(Exception):
    """Base of every error that handcal raises on purpose; its text is shown as it is."""


class CameraError(HandcalError):
    """The camera is missing, failed, or cannot do what was asked."""


class CameraTimeoutError(CameraError):
    """No frame arrived in time; the next read may succeed."""


class CameraEndError(CameraError):
    """A recording has no more frames."""


class HandError(HandcalError):
    """No hand could be segmented in a frame; the text says why."""


class LinkError(HandcalError):
    """The headset could not be reached, or did not acknowledge."""


class FileError(HandcalError):
    """A file is missing, malformed, too large or of an unknown version."""


class PoseError(HandcalError):
    """The headset's pose at a time cannot be told; the text says why."""


class PosePendingError(PoseError):
    """The headset's pose at a time has not arrived yet; asking again soon may succeed."""


class CancelledError(HandcalError):
    """Something long was given up on request; nothing has changed."""
