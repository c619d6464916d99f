"""Settings that the program remembers between runs, and the file that stores them."""

from __future__ import annotations

import logging
import os
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias

from PySide6.QtCore import QObject, QStandardPaths, Signal

from handcal.bridge.bridges import BridgeSettings
from handcal.calibration.plan import PlanSettings
from handcal.core.errors import FileError
from handcal.core.types import EyePlan
from handcal.export.export import ExportSettings
from handcal.io.files import make_folder, read_json, write_json
from handcal.io.settings import read_settings, settings_json
from handcal.link.pairing import Pairings
from handcal.station.settings import StationSettings
from handcal_gui.app.translation import tr
from handcal_gui.evaluate.entries import EvaluationEntries

_LOG = logging.getLogger(__name__)

Theme: TypeAlias = Literal["system", "light", "dark", "contrast"]
PREFERENCES_VERSION = 4
MOST_RECENT = 8
"""Number of sessions that are remembered, and listed on the start page."""
HIDDEN_LAYERS = ("pairs", "solved-cursor")
"""Layers that the hand cloud leaves out at first: the cursor of a finished alignment would cover
residuals."""


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
    sessions: tuple[str, ...] = ()
    """Paths of session folders, newest first. Names of wearers are only in the sessions."""
    export: ExportSettings = field(default_factory=ExportSettings)
    export_folder: str = ""
    """Folder of the last export; empty before the first."""
    fine_tune_step_m: float = 5e-4
    hidden_layers: tuple[str, ...] = HIDDEN_LAYERS
    """Layers of the hand cloud that are switched off."""
    evaluation: EvaluationEntries = field(default_factory=EvaluationEntries)
    bridges: BridgeSettings = field(default_factory=BridgeSettings)
    """Bridges to other programs that every calibration runs."""
    theme: Theme = "system"
    arrangement: Literal["panels", "station"] = "panels"
    """Panels around the guide, or only the guide."""
    runs_itself: bool = True
    """True if steps run automatically, False if each waits for a person."""
    geometry: str = ""
    """Geometry of the window: Qt's state in base64."""
    layout: str = ""
    """The panels that the user has opened or folded, and the widths of their columns, as JSON."""

    def with_session(self, path: Path) -> Self:
        """Return a copy with a session as the newest."""
        newest = str(path.absolute())
        others = (other for other in self.sessions if other != newest)
        return replace(self, sessions=(newest, *others)[:MOST_RECENT])


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

        A file that cannot be read, or of another version, is renamed to end in ``.bad``.
        """
        if not os.path.exists(self.path):
            return Preferences(), ""
        try:
            data = read_json(self.path)
            version = data.pop("version", None)
            if type(version) is not int or version != PREFERENCES_VERSION:
                raise FileError(
                    f"preferences.version is {version!r:.40}, not {PREFERENCES_VERSION}"
                )
            return read_settings(Preferences, data, "preferences"), ""
        except FileError as error:
            bad = self.path.with_name(f"{self.path.name}.bad")
            with suppress(OSError):
                self.path.replace(bad)
            _LOG.warning("the preferences could not be read: %s", error)
            return Preferences(), tr(
                "The preferences could not be read and were reset: check the start page and "
                "Preferences (Ctrl+,) before you start. The old file is {}; the log beside it "
                "says what was wrong."
            ).format(bad)

    def save(self, preferences: Preferences) -> None:
        """Write the preferences, or raise FileError."""
        make_folder(self.path.parent)
        write_json(self.path, {"version": PREFERENCES_VERSION, **settings_json(preferences)})

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


class CurrentPreferences(QObject):
    """The current preferences and pairing keys; every change is written to their file.

    Parameters
    ----------
    file : PreferencesFile
    remembers : bool
        False to change the preferences for this run only.

    Attributes
    ----------
    now : Preferences
    pairings : Pairings
    complaint : str
        A message for the user about the file as it was read, empty if nothing went wrong.
    folder : Path
        The file's folder.
    not_saved : Signal(str)
        A change could not be written; a message for the user.
    """

    not_saved = Signal(str)

    def __init__(self, file: PreferencesFile, remembers: bool) -> None:
        super().__init__()
        self._file, self._remembers = file, remembers
        self.folder = file.path.parent
        self.now, self.complaint = file.load()
        self._instead: dict[str, Any] = {}  # by name: stored in place of settings of one run
        try:
            self.pairings = file.pairings()
        except FileError as error:
            self.pairings = Pairings(())  # for this run: the damaged file stays as it is
            self.complaint = f"{self.complaint} {error}".strip()

    def change(self, **changed: Any) -> None:
        """Change some of the preferences, by their names."""
        self.use(replace(self.now, **changed))

    def use_for_one_run(self, station: StationSettings) -> None:
        """Use other settings of the station; each is remembered only if it is changed again."""
        now = self.now.station
        self._instead = {one.name: getattr(now, one.name) for one in fields(StationSettings)}
        self.now = replace(self.now, station=station)

    def use(self, preferences: Preferences) -> None:
        """Replace all preferences."""
        before, self.now = self.now.station, preferences
        station = preferences.station
        self._instead = {
            name: value
            for name, value in self._instead.items()
            if getattr(station, name) == getattr(before, name)
        }
        try:
            if self._remembers:
                self._file.save(replace(preferences, station=replace(station, **self._instead)))
        except FileError as error:
            self.not_saved.emit(tr("The preferences could not be saved: {}").format(error))

    def add_session(self, path: Path) -> None:
        """Add a session as the newest."""
        self.use(self.now.with_session(path))

    def renew_pairing_key(self) -> None:
        """Forget all headsets and make a new key; raises as `PreferencesFile.renew_pairing_key`."""
        self.pairings = self._file.renew_pairing_key()


def _default_path() -> Path:
    config = QStandardPaths.StandardLocation.AppConfigLocation
    return Path(QStandardPaths.writableLocation(config)) / "preferences.json"
