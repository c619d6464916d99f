"""Formatting of times in the local time zone."""

from __future__ import annotations

from datetime import datetime


def local_time(utc: str, form: str = "%d %b %Y, %H:%M") -> str:
    """Return an ISO 8601 time as local time; other texts unchanged."""
    try:
        return f"{datetime.fromisoformat(utc).astimezone():{form}}"
    except (ValueError, OverflowError):  # overflow: year 1 in another time zone
        return utc
