"""Atomic publishing of several files: all of them appear, or none.

They are written to a hidden folder on the target's disk and moved into place when all are complete.
The next export to the same target removes the remains of a killed program.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from handcal.core.errors import FileError
from handcal.io.closable import Closable
from handcal.io.files import make_folder, refuse_links, sync_folder
from handcal.io.lock import FileLock


class Staging(Closable):
    """A hidden folder for new files of another, which is unchanged unless `publish` succeeds.

    Parameters
    ----------
    folder : Path
        Destination of the files; it need not exist.

    Attributes
    ----------
    path : Path
        Folder to write them to.

    Raises
    ------
    FileError
        If another program is exporting to the same folder, or it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder.absolute()
        # In the folder itself if it exists: it may be a separate disk.
        home = next(path for path in (self._folder, *self._folder.parents) if path.exists())
        if not home.is_dir():
            raise FileError(f"cannot write to {self._folder}: {home} is a file, not a folder")
        self._root = home / f".{self._folder.name}.handcal-export"
        refuse_links(self._root, home)
        try:
            self._lock = FileLock(make_folder(self._root) / "lock")
        except FileError as error:  # it names a folder that nobody chose
            raise FileError(str(error).replace(str(self._root), str(self._folder))) from error
        self.path = self._root / "new"
        self._old = self._root / "old"
        try:
            for leftover in (self.path, self._old):
                if leftover.exists():
                    shutil.rmtree(leftover)
                leftover.mkdir()
        except OSError as error:
            self.close()
            raise FileError(f"cannot write to {self._folder}: {error.strerror or error}") from error

    def publish(self, replaced: Sequence[str]) -> tuple[Path, ...]:
        """Move the files into place and return their new paths, sorted.

        Parameters
        ----------
        replaced : sequence of str
            Patterns, relative to the folder, of the files to replace: matching files that are not
            among the new ones are removed.

        Raises
        ------
        FileError
            If a file cannot be moved or replaced, or a subfolder is a link; the folder is then
            unchanged.
        """
        names = sorted(
            path.relative_to(self.path) for path in self.path.rglob("*") if path.is_file()
        )
        try:
            if self._folder.exists():
                self._merge(names, replaced)
            else:
                make_folder(self._folder.parent)
                for folder in {(self.path / name).parent for name in names}:
                    sync_folder(folder)
                self.path.rename(self._folder)
                sync_folder(self._folder.parent)
        except OSError as error:
            raise FileError(
                f"cannot write to {self._folder}: {error.strerror or error} "
                f"({Path(error.filename or self._folder).name})"
            ) from error
        return tuple(self._folder / name for name in names)

    def close(self) -> None:
        """Remove unpublished files; safe to call twice."""
        self._lock.release()
        shutil.rmtree(self._root, ignore_errors=True)

    def _merge(self, names: Sequence[Path], replaced: Sequence[str]) -> None:
        """Move each file atomically into the existing folder; undo all moves if one fails."""
        stale = {
            path.relative_to(self._folder)
            for pattern in replaced
            for path in self._folder.glob(pattern)
        } - set(names)
        affected = [*names, *stale]
        for name in affected:
            refuse_links((self._folder / name).parent, self._folder)
            if os.path.lexists(self._folder / name):
                make_folder((self._old / name).parent)
                shutil.copy2(self._folder / name, self._old / name, follow_symlinks=False)
        try:
            for name in names:
                make_folder((self._folder / name).parent)
                (self.path / name).replace(self._folder / name)
            for name in stale:
                (self._folder / name).unlink()
            for folder in {(self._folder / name).parent for name in affected}:
                sync_folder(folder)
        except (OSError, FileError):
            for name in affected:
                # A file that cannot be put back, such as one open elsewhere, was not moved.
                with contextlib.suppress(OSError):
                    self._put_back(name)
            raise

    def _put_back(self, name: Path) -> None:
        if os.path.lexists(self._old / name):
            (self._old / name).replace(self._folder / name)
        else:
            (self._folder / name).unlink(missing_ok=True)
