"""The OpenXR layer of this user, and the calibration that it gives to every program."""

from __future__ import annotations

import ctypes
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handcal.core.errors import FileError
from handcal.export.outcome import load_outcome, printable
from handcal.export.tools import openxr_values
from handcal.io.configuration import configuration_folder
from handcal.io.files import (
    make_folder,
    modified_s,
    read_json,
    read_limited,
    write_atomic,
    write_json,
)
from handcal.io.resources import resource_path
from handcal.session.in_force import in_force_path, rig_sha256
from handcal.session.session import SessionRecord

LAYER = "XR_APILAYER_HANDCAL_calibrated_views"
OFF = "HANDCAL_OPENXR_OFF"
"""The environment variable that keeps the layer out of a program."""
IN_FORCE_S = 12.0 * 3600.0
"""The time that a calibration stays in force, unless the user keeps it."""
_LIBRARY = "handcal_openxr.dll" if sys.platform == "win32" else "libhandcal_openxr.so"
_MAX_LIBRARY_BYTES = 2**24
_REGISTRY = r"Software\Khronos\OpenXR\1\ApiLayers\Implicit"


@dataclass(frozen=True, slots=True)
class InForce:
    """The calibration in force."""

    wearer: str
    headset: str
    """The headset's name, or its rig's if it has none."""
    session: str
    age_s: float
    left_s: float | None
    """Until it expires, negative afterwards; None if the user keeps it."""

    def __str__(self) -> str:
        if self.left_s is None:
            end = "kept until it is replaced or the rig changes"
        elif self.left_s > 0.0:
            left = _duration(self.left_s)
            end = f"for {left} more, at most until its session is closed or another begins"
        else:
            end = "expired; calibrate again"
        return (
            f"In force: {self.wearer or 'unnamed wearer'}, {self.headset}, session {self.session}, "
            f"{_duration(self.age_s)} old, {end}."
        )


@dataclass(frozen=True, slots=True)
class LastProgram:
    """The program that the layer was last in, and what became of its views."""

    application: str
    system: str
    """The headset, as the runtime calls it."""
    runtime: str
    state: str
    """``active``, ``refused``, ``off`` or ``waiting`` (for its first frame)."""
    reason: str
    """Of a refusal, or of its being off."""
    age_s: float
    """Since this became so."""

    def __str__(self) -> str:
        return (
            f"Last program: {self.application} on {self.system} ({self.runtime}), "
            f"{_duration(self.age_s)} ago: {self.state}{self.reason and f', {self.reason}'}"
        )


@dataclass(frozen=True, slots=True)
class LayerStatus:
    """The layer and the calibration that OpenXR programs of this user find."""

    is_installed: bool
    is_current: bool
    """The installed layer is the one of this handcal."""
    in_force: InForce | None
    last_program: LastProgram | None

    @property
    def lines(self) -> tuple[str, ...]:
        """The status for a person: layer, calibration and, if there was one, program."""
        if not self.is_installed:
            layer = "The layer is not installed; install it: handcal openxr install"
        elif not self.is_current:
            layer = "Installed, of another handcal; run handcal openxr install again."
        else:
            layer = "Installed: every OpenXR program of this user loads the layer."
        none = "No calibration is in force; choose one: handcal openxr use SESSION"
        program = (str(self.last_program),) if self.last_program else ()
        return layer, str(self.in_force or none), *program


def install_layer() -> Path:
    """Have every OpenXR program of this user load the layer, and return its manifest.

    Raises
    ------
    FileError
        If it cannot be written, has not been built, or there is none for this system.
    """
    library, data = _library(), read_limited(_shipped_library(), _MAX_LIBRARY_BYTES)
    make_folder(library.parent)
    try:  # not copied over: running programs have the old one in their memory
        write_atomic(library, data)
    except FileError as error:
        advice = "if OpenXR programs are running, end them and try again"
        raise FileError(error.what, advice) from error
    manifest = _manifest()
    make_folder(manifest.parent)
    layer = {
        "name": LAYER,
        "library_path": str(library),
        "api_version": "1.0",
        "implementation_version": "1",
        "description": "Renders with the eyes that handcal has calibrated",
        "disable_environment": OFF,
    }
    write_json(manifest, {"file_format_version": "1.0.0", "api_layer": layer})
    if sys.platform == "win32":
        import winreg

        with winreg.CreateKey(winreg.HKEY_CURRENT_USER, _REGISTRY) as key:
            winreg.SetValueEx(key, str(manifest), 0, winreg.REG_DWORD, 0)
    return manifest


def remove_layer() -> bool:
    """Remove the layer and end the calibration in force; return whether there was a layer.

    Raises
    ------
    FileError
        If a file cannot be removed.
    """
    manifest = _manifest()
    was_there = manifest.exists()
    if sys.platform == "win32":
        import winreg

        access = winreg.KEY_SET_VALUE
        with (
            suppress(FileNotFoundError),
            winreg.OpenKey(winreg.HKEY_CURRENT_USER, _REGISTRY, 0, access) as key,
        ):
            winreg.DeleteValue(key, str(manifest))
    for path in (manifest, in_force_path(), _status_path(), _library()):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise FileError(
                f"cannot remove {path}: {error.strerror}",
                "end all OpenXR programs",
            ) from error
    return was_there


def use_calibration(record: SessionRecord, *, keep: bool = False) -> None:
    """Put a session's final calibration in force, in place of any other.

    Parameters
    ----------
    record : SessionRecord
    keep : bool
        Until it is replaced, or the rig changes; otherwise for `IN_FORCE_S`, at most until its
        session is closed or another begins.

    Raises
    ------
    FileError
        If it cannot be solved, expressed or written.
    """
    values = openxr_values(load_outcome(record))
    values["expiresUnixS"] = 0 if keep else time.time() + IN_FORCE_S
    values["sessionPath"] = str(record.path.absolute())
    values["rigSha256"] = rig_sha256(record.path)
    make_folder(in_force_path().parent)
    write_json(in_force_path(), values)


@contextmanager
def correction_owner(name: str) -> Iterator[None]:
    """Have the layer pass this program's views through, as the program corrects by itself.

    It names the owner to the installed layer, if there is one, which is loaded into this process.
    """
    library = None
    with suppress(FileError, OSError, AttributeError):  # none for this system, or an older one
        if _manifest().exists():
            library = ctypes.CDLL(str(_library()))
            library.handcal_correction_owner(name.encode())
    try:
        yield
    finally:
        if library is not None:
            library.handcal_correction_owner(None)


def layer_status() -> LayerStatus:
    """Return whether the layer is installed, what is in force, and what it last did.

    Raises
    ------
    FileError
        If there is none for this system, or a file of the configuration is damaged.
    """
    library, is_installed = _library(), _manifest().exists()
    is_current = False
    with suppress(FileError, OSError):
        is_current = library.read_bytes() == _shipped_library().read_bytes()
    last, told_path = None, _status_path()
    if told_path.exists():
        told = read_json(told_path)
        names = "application", "system", "runtime", "state", "reason"
        last = LastProgram(**{name: _text(told, name) for name in names}, age_s=_age_s(told_path))
    return LayerStatus(is_installed, is_installed and is_current, _in_force(), last)


def _in_force() -> InForce | None:
    path = in_force_path()
    if not path.exists():
        return None
    data = read_json(path)
    expires_s = data.get("expiresUnixS")
    if not isinstance(expires_s, int | float):
        raise FileError(f"{path} is damaged", "put a calibration in force again")
    return InForce(
        wearer=_text(data, "wearer"),
        headset=_text(data, "headset") or _text(data, "rig"),
        session=_text(data, "session"),
        age_s=_age_s(path),
        left_s=expires_s - time.time() if expires_s else None,
    )


def _duration(time_s: float) -> str:
    minutes = round(time_s / 60.0)
    return f"{minutes} min" if minutes < 120 else f"{minutes / 60.0:.1f} h"


def _text(data: dict[str, Any], key: str) -> str:
    return printable(str(data.get(key, "")))


def _age_s(path: Path) -> float:
    return max(0.0, time.time() - modified_s(path))


def _status_path() -> Path:
    return configuration_folder() / "openxr-status.json"


def _shipped_library() -> Path:
    folder = resource_path("openxr")
    library = folder / _LIBRARY
    if library.exists():
        return library
    if (folder.parents[1] / "installer/openxr.sh").exists():
        raise FileError("the layer has not been built yet", "run: bash installer/openxr.sh")
    raise FileError(f"the shipped file openxr/{_LIBRARY} is missing", "install handcal again")


def _data_folder() -> Path:
    if sys.platform == "win32":
        return configuration_folder()
    if sys.platform == "darwin":
        raise FileError("there is no OpenXR layer for macOS", "use Linux or Windows")
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local/share")


def _library() -> Path:
    return _data_folder() / ("openxr" if sys.platform == "win32" else "handcal") / _LIBRARY


def _manifest() -> Path:
    if sys.platform == "win32":
        return _library().with_name("handcal.json")
    return _data_folder() / "openxr/1/api_layers/implicit.d/handcal.json"
