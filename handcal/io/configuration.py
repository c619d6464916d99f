"""The folder of the user's configuration, and what libraries keep there."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def configuration_folder() -> Path:
    """Return the folder where the desktop program keeps its preferences; it need not exist."""
    if sys.platform == "win32":
        local = os.environ.get("LOCALAPPDATA")
        return (Path(local) if local else Path.home() / "AppData/Local") / "handcal"
    if sys.platform == "darwin":
        return Path.home() / "Library/Preferences/handcal"
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "handcal"


def keep_font_list_in_configuration() -> None:
    """Let matplotlib keep its list of fonts in the configuration, unless the user says where.

    Call it before matplotlib is imported, from a program only: a library that uses handcal may
    have settings of its own for matplotlib.
    """
    os.environ.setdefault("MPLCONFIGDIR", str(configuration_folder() / "matplotlib"))
