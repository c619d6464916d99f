"""Settings that the program remembers between runs, and the file that stores them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, Self, TypeAlias

from PySide6.QtCore import QStandardPaths

from handcal.errors import FileError
from handcal.export.export import ExportSettings
from handcal.io.files import make_folder, read_json, write_json
from handcal.io.settings import read_settings, settings_json
from handcal.link.pairing import Pairings
from handcal.station.plan import PlanSettings
from handcal.station.settings import StationSettings
from handcal.types import EyePlan
from handcal_gui.evaluation_entries import EvaluationEntries

Theme: TypeAlias = Literal["system", "light", "dark", "contrast"]
_MOST_WEARERS, _MOST_SESSIONS = 20, 8


def _default_station() -> StationSettings:
    documents = QStandardPaths.StandardLocation.DocumentsLocation
    folder = Path(QStandardPaths.writableLocation(documents)) / "handcal sessions"
    plan = PlanSettings("recommended", is_automatic=True)
    return StationSettings(sessions=str(folder), plan=plan)


@dataclass(frozen=True, slots=True)
class Preferences:
    """The technician's choices, proposed again at the next start."""

    station: StationSettings = field(default_factory=_default_station)
    plan: EyePlan = "each"
    """The order in which the eyes are aligned."""
    wearers: tuple[str, ...] = ()
    sessions: tuple[str, ...] = ()
    """Names of wearers, and paths of session folders; newest first."""
    export: ExportSettings = field(default_factory=ExportSettings)
    export_folder: str = ""
    """Folder of the last export; empty before the first."""
    fine_tune_step_m: float = 5e-4
    evaluation: EvaluationEntries = field(default_factory=EvaluationEntries)
    theme: Theme = "system"
    arrangement: Literal["panels", "station"] = "panels"
    """Panels around the guide, or the guide alone."""
    runs_itself: bool = True
    """True if steps run by themselves, False if each waits for a person."""
    geometry: str = ""
    live_layout: str = ""
    review_layout: str = ""
    """Geometry of the window and layouts of its docks on either page: Qt's state in base64."""

    def with_wearer(self, name: str) -> Self:
        """Return a copy with a wearer's name as the newest."""
        return replace(self, wearers=_newest_first(name, self.wearers, _MOST_WEARERS))

    def with_session(self, path: Path) -> Self:
        """Return a copy with a session as the newest."""
        newest = str(path.absolute())
        return replace(self, sessions=_newest_first(newest, self.sessions, _MOST_SESSIONS))


class PreferencesFile:
    """The file of the preferences (JSON), and the pairing keys, which only the user can read.

    Parameters
    ----------
    path : Path, optional
        By default in the user's configuration folder; the keys are stored beside it.

    Attributes
    ----------
    path : Path
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path or _default_path()
        self._key_path = self.path.with_name("pairing.key")

    def load(self) -> tuple[Preferences, str]:
        """Return the preferences and a message for the user, empty if nothing went wrong.

        A file that cannot be read is renamed to end in ``.bad``.
        """
        if not self.path.exists():
            return Preferences(), ""
        try:
            return read_settings(Preferences, read_json(self.path), "preferences"), ""
        except FileError as error:
            bad = self.path.with_name(f"{self.path.name}.bad")
            with suppress(OSError):
                self.path.replace(bad)
            return Preferences(), (
                "The preferences could not be read and were reset; "
                f"the old file was kept as {bad}: {error}"
            )

    def save(self, preferences: Preferences) -> None:
        """Write the preferences, or raise FileError."""
        make_folder(self.path.parent)
        write_json(self.path, settings_json(preferences))

    def pairings(self) -> Pairings:
        """Return the paired headsets, with a key for the next one.

        Raises
        ------
        FileError
            If the file is damaged, or a new key cannot be written.
        """
        pairings = Pairings.read(self._key_path)
        pairings.open_key()
        return pairings

    def renew_pairing_key(self) -> Pairings:
        """Forget all headsets and make a new key; headsets with an old key can no longer connect.

        Raises
        ------
        FileError
            If the key cannot be written.
        """
        pairings = Pairings((), self._key_path)
        pairings.open_key()
        return pairings


def _default_path() -> Path:
    config = QStandardPaths.StandardLocation.AppConfigLocation
    return Path(QStandardPaths.writableLocation(config)) / "preferences.json"


def _newest_first(newest: str, others: tuple[str, ...], most: int) -> tuple[str, ...]:
    if not newest:
        return others
    return (newest, *(other for other in others if other != newest))[:most]
