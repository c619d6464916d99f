"""The export dialog: it writes the chosen files, or changes nothing and shows the reason."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QLabel,
    QListWidget,
    QProgressBar,
    QPushButton,
)
from pytestqt.qtbot import QtBot

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.export.export import ExportSettings, export_session
from handcal.export.many import Exported
from handcal.session.session import SessionRecord
from handcal_gui.dialogs.export import ExportDialog
from handcal_gui.widgets.path_field import PathField
from tests.gui.helpers import child, letters, note_opened, text


class Exporter:
    """Stands in for the export: waits to be let on, fails if told, and can be cancelled."""

    def __init__(self) -> None:
        self.may_end = threading.Event()
        self.doing = "Report (PDF)"
        self.failure = ""
        self.missing: tuple[str, ...] = ()
        self.names: tuple[str, ...] = ("a.csv", "clouds/b.ply")
        self.folders: list[Path] = []
        self.settings: list[ExportSettings] = []

    def __call__(self, folder: Path, settings: ExportSettings, progress: Progress) -> Exported:
        self.folders.append(folder)
        self.settings.append(settings)
        progress.at(0.25, self.doing)
        while not self.may_end.wait(0.01):
            progress.check()
        if self.failure:
            raise FileError(self.failure)
        return Exported(tuple(folder / name for name in self.names), self.missing)


@pytest.fixture
def exporter() -> Iterator[Exporter]:
    exporter = Exporter()
    yield exporter
    exporter.may_end.set()


@pytest.fixture
def dialog(
    qtbot: QtBot, record: SessionRecord, tmp_path: Path, exporter: Exporter
) -> Iterator[ExportDialog]:
    settings = ExportSettings(("report", "csv"))
    dialog = ExportDialog(record.path.name, settings, tmp_path / "out", exporter)
    qtbot.addWidget(dialog)
    dialog.show()
    qtbot.waitUntil(press(dialog, "export").isEnabled)  # the folder is checked
    yield dialog
    exporter.may_end.set()
    qtbot.waitUntil(lambda: press(dialog, "close").text() == "&Close")


def press(dialog: ExportDialog, name: str) -> QPushButton:
    found = dialog.findChild(QPushButton, name)
    assert isinstance(found, QPushButton)
    return found


def box(dialog: ExportDialog, name: str) -> QCheckBox:
    found = dialog.findChild(QCheckBox, name)
    assert isinstance(found, QCheckBox)
    return found


def files(dialog: ExportDialog) -> list[str]:
    found = dialog.findChild(QListWidget, "files")
    assert isinstance(found, QListWidget)
    return [found.item(row).text() for row in range(found.count())]


def test_what_is_chosen_is_exported_and_remembered(
    qtbot: QtBot,
    dialog: ExportDialog,
    exporter: Exporter,
    record: SessionRecord,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    far = dialog.findChild(QDoubleSpinBox, "far")
    assert isinstance(far, QDoubleSpinBox)
    assert not far.isEnabled()
    box(dialog, "csv").click()
    box(dialog, "json").click()
    assert far.isEnabled()
    box(dialog, "json").click()
    assert not far.isEnabled()
    box(dialog, "unity").click()
    assert far.isEnabled()
    far.setValue(50.0)
    with qtbot.waitSignal(dialog.remembered) as remembered:
        press(dialog, "export").click()
    expected = ExportSettings(("report", "unity"), far_m=50.0)
    assert remembered.args == [expected, tmp_path / "out"]
    bar = dialog.findChild(QProgressBar, "progress")
    assert isinstance(bar, QProgressBar)
    qtbot.waitUntil(lambda: bar.value() == bar.maximum() // 4)
    assert text(dialog, "doing") == "Report (PDF)…"
    exporter.may_end.set()
    qtbot.waitUntil(lambda: text(dialog, "doing") == "Done.")
    target = tmp_path / "out" / f"{record.path.name}-export"
    assert (exporter.folders, exporter.settings) == ([target], [expected])
    assert files(dialog) == ["a.csv", str(Path("clouds") / "b.ply")]
    assert str(target) in text(dialog, "exportEndFound")
    opened = note_opened(monkeypatch)
    press(dialog, "exportEndFix").click()
    assert opened == [target]
    assert press(dialog, "openReport").isHidden()  # none was made


def test_the_report_that_was_made_opens_with_a_letter(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = note_opened(monkeypatch)
    exporter.names = ("a.csv", "report.html", "report.pdf")
    exporter.may_end.set()
    press(dialog, "export").click()
    qtbot.waitUntil(press(dialog, "openReport").isVisible)
    assert sorted(letters(dialog, is_shown=True)) == ["b", "c", "o", "r"]
    press(dialog, "openReport").click()
    assert opened == [exporter.folders[0] / "report.pdf"]
    press(dialog, "back").click()
    exporter.names = ("a/report.pdf", "b/report.pdf")
    qtbot.waitUntil(press(dialog, "export").isEnabled)
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: text(dialog, "doing") == "Done.")
    assert press(dialog, "openReport").isHidden()  # which of them?


def test_without_formats_or_folder_nothing_can_be_exported(dialog: ExportDialog) -> None:
    for name in ("report", "csv"):
        box(dialog, name).click()
    assert not press(dialog, "export").isEnabled()
    assert "nothing is ticked" in text(dialog, "exportTask")
    box(dialog, "zip").click()
    assert press(dialog, "export").isEnabled()
    assert text(dialog, "exportTask") == "Choose what to write and where, then export."
    folder = dialog.findChild(PathField)
    assert isinstance(folder, PathField)
    folder.set_path("")
    assert not press(dialog, "export").isEnabled()
    assert text(dialog, "exportTask") == "Choose the folder to export to."
    assert not child(dialog, QLabel, "folderFound").isVisible()


def test_it_fits_a_small_screen_and_a_heading_stands_by_its_own_group(
    dialog: ExportDialog,
) -> None:
    assert dialog.height() <= 510
    (heading,) = (one for one in dialog.findChildren(QLabel) if one.text().startswith("For one"))
    text_top = heading.y() + heading.contentsRect().top()
    below = box(dialog, "unity").y() - heading.geometry().bottom()
    assert text_top - box(dialog, "zip").geometry().bottom() > 2 * below


def test_a_folder_that_cannot_be_created_is_refused_beside_it(
    qtbot: QtBot, dialog: ExportDialog, tmp_path: Path
) -> None:
    made = f"The export will create the folder {dialog._choices.target.name} there."
    qtbot.waitUntil(lambda: text(dialog, "folderFound") == made)
    field, file = child(dialog, PathField), tmp_path / "file"
    file.touch()
    field.set_path(str(file / "folder"))
    refused = f"{file} is a file; choose a folder."
    qtbot.waitUntil(lambda: text(dialog, "folderFound") == refused)
    assert text(dialog, "exportTask") == "Choose another folder to export to."
    assert not press(dialog, "export").isEnabled()
    field.set_path(str(tmp_path / "new"))
    qtbot.waitUntil(press(dialog, "export").isEnabled)
    assert text(dialog, "folderFound") == made
    earlier = tmp_path / "earlier" / dialog._choices.target.name
    earlier.mkdir(parents=True)
    (earlier / "parameters.csv").touch()
    field.set_path(str(earlier.parent))
    qtbot.waitUntil(lambda: text(dialog, "folderFound").endswith("there will be replaced."))
    assert child(dialog, QLabel, "folderHealth").accessibleName() == "Note"
    assert press(dialog, "export").isEnabled()


def test_a_failure_is_reported_and_can_be_tried_again(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    exporter.failure = "cannot write /x: No space left on device"
    exporter.may_end.set()
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: "No space left on device" in text(dialog, "exportEndFound"))
    assert "go back to choose another folder, or to try again" in text(dialog, "exportEndFound")
    assert files(dialog) == []
    exporter.failure = ""
    press(dialog, "back").click()
    assert press(dialog, "export").isVisible()
    qtbot.waitUntil(press(dialog, "export").isEnabled)
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: len(files(dialog)) == 2)


def test_sessions_that_were_not_exported_are_named_above_the_files(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    exporter.missing = ("bea: it has no alignments",)
    exporter.may_end.set()
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: text(dialog, "doing") == "1 session not exported, see below.")
    bar = dialog.findChild(QProgressBar, "progress")
    assert isinstance(bar, QProgressBar)
    assert bar.isHidden()  # it would stay at the last share
    assert files(dialog)[:2] == ["bea: it has no alignments", "a.csv"]


def test_if_no_session_was_exported_it_says_what_to_do(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    exporter.names, exporter.missing = (), (f"bea: cannot write {90 * 'a '}",)
    exporter.may_end.set()
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: text(dialog, "exportEndFound").startswith("Nothing was exported;"))
    assert "choose another folder" in text(dialog, "exportEndFound")
    assert press(dialog, "exportEndFix").isHidden()
    listed = dialog.findChild(QListWidget, "files")
    assert isinstance(listed, QListWidget)
    assert listed.visualItemRect(listed.item(0)).width() <= listed.viewport().width()


def test_a_long_name_neither_widens_the_dialog_nor_is_markup(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    least_px = dialog.minimumSizeHint().width()
    exporter.doing = f"1 of 3: <b>{90 * 'W'}, Report"
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: text(dialog, "doing") == f"{exporter.doing}…")
    doing = dialog.findChild(QLabel, "doing")
    assert isinstance(doing, QLabel)
    assert doing.textFormat() == Qt.TextFormat.PlainText
    assert dialog.minimumSizeHint().width() == least_px
    exporter.may_end.set()
    qtbot.waitUntil(lambda: text(dialog, "doing") == "Done.")


def test_cancel_stops_the_export_and_keeps_the_dialog(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: bool(exporter.folders))
    press(dialog, "close").click()  # the export itself would wait for ever
    qtbot.waitUntil(lambda: "Cancelled" in text(dialog, "exportEndFound"))
    assert dialog.isVisible()
    press(dialog, "close").click()
    assert not dialog.isVisible()


def test_esc_cancels_the_export_and_says_so_and_closes_only_then(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: bool(exporter.folders))
    for _ in range(2):
        QTest.keyClick(dialog, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: "Cancelled" in text(dialog, "exportEndFound"))
    assert dialog.isVisible()
    assert text(dialog, "doing") == "Nothing was exported."
    QTest.keyClick(dialog, Qt.Key.Key_Escape)
    assert not dialog.isVisible()


def test_closing_while_it_runs_cancels_and_then_closes(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: bool(exporter.folders))
    with qtbot.waitSignal(dialog.rejected):
        dialog.close()
    assert not [t for t in threading.enumerate() if t.name == "handcal job"]


def test_every_choice_has_a_letter_of_its_own(dialog: ExportDialog) -> None:
    found = letters(dialog, is_shown=True)
    boxes = dialog.findChildren(QCheckBox)
    assert all("&" in box.text() for box in boxes)
    assert len(set(found)) == len(found) == len(boxes) + 5


def test_a_real_session_is_exported(qtbot: QtBot, record: SessionRecord, tmp_path: Path) -> None:
    settings = ExportSettings(("csv", "unity", "yaml"))
    dialog = ExportDialog(
        record.path.name,
        settings,
        tmp_path / "out",
        lambda *where: Exported(export_session(record, *where)),
    )
    qtbot.addWidget(dialog)
    dialog.start()
    qtbot.waitUntil(lambda: text(dialog, "doing") == "Done.", timeout=20_000)
    target = tmp_path / "out" / f"{record.path.name}-export"
    made = sorted(path.name for path in target.iterdir())
    wanted = ["calibration.yaml", "parameters.csv", "trials.csv", "unity.json"]
    assert made == wanted == sorted(files(dialog))
