"""The connection to an X server, tested before a library aborts or waits for it."""

from __future__ import annotations

import ctypes


def x_server_answers(display: str) -> bool:
    """Return whether an X server accepts a connection by this user; True if none can be tested.

    Parameters
    ----------
    display : str
        Value of the variable ``DISPLAY``.
    """
    try:
        xcb = ctypes.CDLL("libxcb.so.1")
    except OSError:
        return True  # who needs the library names it
    xcb.xcb_connect.restype = ctypes.c_void_p
    connection = ctypes.c_void_p(xcb.xcb_connect(display.encode(), None))
    has_error = bool(xcb.xcb_connection_has_error(connection))
    xcb.xcb_disconnect(connection)
    return not has_error
