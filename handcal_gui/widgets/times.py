"""Formatting of times in the local time zone."""

from __future__ import annotations

from datetime import UTC, datetime

_FOLDER = "session-%Y%m%d-%H%M%S-%f"
"""The name that `Session.create` gives a folder, with the time in UTC."""


def local_time(utc: str, form: str = "%Y-%m-%d %H:%M") -> str:
    """Return an ISO 8601 time as local time, the same in every language; other texts unchanged."""
    try:
        return f"{datetime.fromisoformat(utc).astimezone():{form}}"
    except (ValueError, OverflowError):  # overflow: year 1 in another time zone
        return utc


def session_time(folder: str) -> str:
    """Return when a session began, as local time, from its folder's name; other names unchanged."""
    try:
        began = datetime.strptime(folder, _FOLDER).replace(tzinfo=UTC)
    except ValueError:
        return folder
    return local_time(began.isoformat())
