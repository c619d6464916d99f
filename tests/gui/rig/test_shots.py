from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handcal.camera.take_board import keep_images
from handcal.core.errors import CancelledError
from handcal.core.progress import Progress
from handcal.rig.boards.views import ViewsError
from handcal_gui.rig.shots import excluding, look


def test_pairs_are_looked_through(photographs: Any) -> None:
    told: list[float] = []
    folders = [photographs.folder / name for name in ("depth", "headset")]
    shots = look(folders, photographs.work.board, Progress(lambda _, share: told.append(share)))
    assert [shot.name for shot in shots][::8] == ["depth-001.png", "depth-099.png"]
    assert shots[0].files == tuple(folder / f"{folder.name}-001.png" for folder in folders)
    assert all(view.found for shot in shots[:8] for view in shot.views)
    assert shots[8].problem
    assert shots[0].small is not None
    assert max(shots[0].small.shape) == 96
    assert told == sorted(told)
    assert 0.9 < told[-1] < 1.0


def test_what_is_left_out_is_marked(photographs: Any) -> None:
    shots = look([photographs.folder / "grid-left"], photographs.work.board)
    views = excluding(shots, ["grid-left-002.png"])
    assert [[view.dropped for view in one] for one in views] == [[False], [True], [False]]


def test_looking_can_be_given_up(photographs: Any) -> None:
    with pytest.raises(CancelledError):
        look(
            [photographs.folder / "depth"],
            photographs.work.board,
            Progress(is_cancelled=lambda: True),
        )


def test_images_that_do_not_belong_together_are_told(photographs: Any, tmp_path: Path) -> None:
    keep_images([np.zeros((100, 100, 3), np.uint8)] * 2, [tmp_path / "a", tmp_path / "b"])
    (tmp_path / "b" / "b-001.png").rename(tmp_path / "b" / "b-7.png")
    with pytest.raises(ViewsError, match="belong together"):
        look([tmp_path / "a", tmp_path / "b"], photographs.work.board)
