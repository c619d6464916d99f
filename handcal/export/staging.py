"""Files that appear together or not at all.

They are made in a hidden folder on the disk of the target and moved in place when all are
complete. What a killed program leaves of it, the next export to the same target removes.
"""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Sequence
from pathlib import Path

from handcal.errors import FileError
from handcal.io.closable import Closable
from handcal.io.files import make_folder
from handcal.io.lock import FileLock


class Staging(Closable):
    """A hidden place to make files for a folder, which is left as it was unless `publish` succeeds.

    Parameters
    ----------
    folder : Path
        Where the files shall go; it need not exist.

    Attributes
    ----------
    path : Path
        Where to make them.

    Raises
    ------
    FileError
        If another program is making files for the same folder, or nothing can be written there.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder.absolute()
        # In the folder itself if it exists: it may be a disk of its own.
        home = next(path for path in (self._folder, *self._folder.parents) if path.is_dir())
        self._root = make_folder(home / f".{self._folder.name}.handcal-export")
        self._lock = FileLock(self._root / "lock")
        self.path = self._root / "new"
        self._old = self._root / "old"
        try:
            for leftover in (self.path, self._old):
                if leftover.exists():
                    shutil.rmtree(leftover)
                leftover.mkdir()
        except OSError as error:
            self.close()
            raise FileError(f"cannot write {self._root}: {error.strerror or error}") from error

    def publish(self, replaced: Sequence[str]) -> tuple[Path, ...]:
        """Move the files in place and return where they are now, in order.

        Parameters
        ----------
        replaced : sequence of str
            Patterns of the files that these replace, relative to the folder: what matches and is
            not among them is removed.

        Raises
        ------
        FileError
            If a file cannot be moved or replaced; all is then as it was.
        """
        names = sorted(
            path.relative_to(self.path) for path in self.path.rglob("*") if path.is_file()
        )
        try:
            if self._folder.exists():
                self._merge(names, replaced)
            else:
                make_folder(self._folder.parent)
                self.path.rename(self._folder)
        except OSError as error:
            raise FileError(
                f"cannot write to {self._folder}: {error.strerror or error} "
                f"({Path(error.filename or self._folder).name})"
            ) from error
        return tuple(self._folder / name for name in names)

    def close(self) -> None:
        """Remove what was not published; safe to call twice."""
        self._lock.release()
        shutil.rmtree(self._root, ignore_errors=True)

    def _merge(self, names: Sequence[Path], replaced: Sequence[str]) -> None:
        """Move the files into the existing folder, each at one stroke; undo all if one fails."""
        stale = {
            path.relative_to(self._folder)
            for pattern in replaced
            for path in self._folder.glob(pattern)
        } - set(names)
        affected = [*names, *stale]
        for name in affected:
            if (self._folder / name).exists():
                make_folder((self._old / name).parent)
                shutil.copy2(self._folder / name, self._old / name)
        try:
            for name in names:
                make_folder((self._folder / name).parent)
                (self.path / name).replace(self._folder / name)
            for name in stale:
                (self._folder / name).unlink()
        except (OSError, FileError):
            for name in affected:
                # What cannot be put back, such as a file that is open elsewhere, was not moved.
                with contextlib.suppress(OSError):
                    self._put_back(name)
            raise

    def _put_back(self, name: Path) -> None:
        if (self._old / name).exists():
            (self._old / name).replace(self._folder / name)
        else:
            (self._folder / name).unlink(missing_ok=True)
