"""Provenance of a report: versions, machine and settings."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

import numpy as np

from handcal.report.document import Item, facts

# Most settings listed; the file holds the others.
_MAX_SETTINGS = 120
_MAX_CHARACTERS = 200


def made_with() -> dict[str, str]:
    """Return the software, machine and time with which a report is made."""
    return {
        "Made with": f"handcal {version('handcal')}, Python {platform.python_version()}, "
        f"NumPy {np.__version__}, on {platform.system()} {platform.machine()}",
        "Made at": at_minute(datetime.now(UTC).isoformat()),
    }


def settings_items(
    settings: Mapping[str, Any], file: str = "settings.json", defaults: Mapping[str, Any] = {}
) -> list[Item]:
    """Return nested settings that are not the defaults as a table.

    Below it stands how many more `file` has.
    """
    usual = dict(_flat(defaults))
    rows = [(name, value) for name, value in _flat(settings) if usual.get(name) != value]
    if not rows:
        return ["All settings are the defaults."]
    items: list[Item] = [facts(dict(rows[:_MAX_SETTINGS]))]
    if len(rows) > _MAX_SETTINGS:
        items.append(f"and {len(rows) - _MAX_SETTINGS:,} more, in {file}")
    return items


def at_minute(iso: str) -> str:
    """Return a time, ISO 8601 in UTC, to the minute."""
    return f"{iso[:10]} {iso[11:16]} UTC"


def _flat(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Return nested values as rows of a name with dots and a short text."""
    rows: list[tuple[str, str]] = []
    for name, value in values.items():
        if isinstance(value, Mapping) and value:
            rows += _flat(value, f"{prefix}{name}.")
        else:
            text = f"{value:.6g}" if isinstance(value, float) else str(value)
            rows.append((_short(f"{prefix}{name}"), _short(text)))
    return rows


def _short(text: str) -> str:
    return text if len(text) <= _MAX_CHARACTERS else f"{text[: _MAX_CHARACTERS - 1]}…"
