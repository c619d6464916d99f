"""The rig window's dialogs for files, which begin in the folder used last."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QWidget

from handcal_gui.rig.project import RigProject


def ask_save(
    project: RigProject, parent: QWidget, title: str, name: str, pattern: str
) -> Path | None:
    """Let the user choose where to save a file of a proposed name; None if cancelled."""
    proposed = str(Path(project.inputs.chosen_folder) / name)
    return _chosen(project, QFileDialog.getSaveFileName(parent, title, proposed, pattern)[0])


def ask_open(project: RigProject, parent: QWidget, title: str, pattern: str) -> Path | None:
    """Let the user choose a file; None if cancelled."""
    folder = project.inputs.chosen_folder
    return _chosen(project, QFileDialog.getOpenFileName(parent, title, folder, pattern)[0])


def _chosen(project: RigProject, text: str) -> Path | None:
    if not text:
        return None
    path = Path(text)
    project.enter(chosen_folder=str(path.parent.absolute()))
    return path
