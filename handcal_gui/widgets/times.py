"""Times as the clock on the wall shows them."""

from __future__ import annotations

from datetime import datetime


def local_time(utc: str, form: str = "%d %b %Y, %H:%M") -> str:
    """Return a time in ISO 8601 as local time; as it is if it is no time."""
    try:
        return f"{datetime.fromisoformat(utc).astimezone():{form}}"
    except (ValueError, OverflowError):  # overflow: the year 1, somewhere else
        return utc
