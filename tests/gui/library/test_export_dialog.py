"""The export dialog: it writes the chosen files, or changes nothing and shows the reason."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QCheckBox, QDoubleSpinBox, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.export.export import Exported, ExportSettings, export_session
from handcal.session.session import SessionRecord
from handcal_gui.library.export_dialog import ExportDialog
from handcal_gui.widgets.path_field import PathField
from tests.gui.helpers import child, letters, note_opened, text


class Exporter:
    """Stands in for the export: waits to be let on, fails if told, and can be cancelled."""

    def __init__(self) -> None:
        self.may_end = threading.Event()
        self.doing = "Report (PDF)"
        self.failure = self.sentence = ""
        self.missing: tuple[str, ...] = ()
        self.names: tuple[str, ...] = ("a.csv", "clouds/b.ply")
        self.asked: list[tuple[Path, ExportSettings]] = []

    def __call__(self, folder: Path, settings: ExportSettings, progress: Progress) -> Exported:
        self.asked.append((folder, settings))
        progress.at(0.25, self.doing)
        while not self.may_end.wait(0.01):
            progress.check()
        if self.failure:
            raise FileError(self.failure)
        return Exported(
            tuple(folder / name for name in self.names), self.missing, sentence=self.sentence
        )


@pytest.fixture
def exporter() -> Iterator[Exporter]:
    exporter = Exporter()
    yield exporter
    exporter.may_end.set()


@pytest.fixture
def dialog(qtbot: QtBot, tmp_path: Path, exporter: Exporter) -> Iterator[ExportDialog]:
    settings = ExportSettings(("report", "csv"))
    dialog = ExportDialog("2026-11-28-Anna", settings, tmp_path / "out", exporter, "Anna")
    qtbot.addWidget(dialog)
    dialog.show()
    qtbot.waitUntil(press(dialog, "export").isEnabled)  # the folder is checked
    yield dialog
    exporter.may_end.set()
    dialog.stop()


def press(dialog: ExportDialog, name: str) -> QPushButton:
    return child(dialog, QPushButton, name)


def box(dialog: ExportDialog, name: str) -> QCheckBox:
    return child(dialog, QCheckBox, name)


def export(qtbot: QtBot, dialog: ExportDialog, exporter: Exporter) -> None:
    """Export to the end."""
    exporter.may_end.set()
    press(dialog, "export").click()
    qtbot.waitUntil(press(dialog, "back").isVisible)


def test_what_is_chosen_is_exported_and_remembered(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter, tmp_path: Path
) -> None:
    far = child(dialog, QDoubleSpinBox, "far")
    assert not far.isEnabled()
    for name, has_planes in (("csv", False), ("json", True), ("json", False), ("unity", True)):
        box(dialog, name).click()
        assert far.isEnabled() == has_planes
    far.setValue(50.0)
    with qtbot.waitSignal(dialog.remembered) as remembered:
        press(dialog, "export").click()
    expected = ExportSettings(("report", "unity"), far_m=50.0)
    assert remembered.args == [expected, tmp_path / "out"]
    qtbot.waitUntil(lambda: text(dialog, "doing") == "Report (PDF)…")
    exporter.may_end.set()
    qtbot.waitUntil(press(dialog, "back").isVisible)
    target = tmp_path / "out" / "2026-11-28-Anna"
    assert exporter.asked == [(target, expected)]
    assert text(dialog, "exportEndFound") == f"2 files in {target}."


def test_what_was_made_is_opened_and_copied(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = note_opened(monkeypatch)
    exporter.names = ("a/report.pdf", "report.html", "report.pdf")
    exporter.sentence = "5 wearers were calibrated."
    exporter.missing = ("bea: it has no alignments",)
    export(qtbot, dialog, exporter)
    target = exporter.asked[0][0]
    for name in ("openReport", "openFolder"):
        press(dialog, name).click()
    assert opened == [target / "report.pdf", target], "the report over all, not that of a session"
    press(dialog, "copyPath").click()
    assert QGuiApplication.clipboard().text() == str(target)
    assert text(dialog, "sentence") == exporter.sentence
    press(dialog, "copySentence").click()
    assert QGuiApplication.clipboard().text() == exporter.sentence
    assert "1 session not exported, see below" in text(dialog, "exportEndFound")
    assert text(dialog, "missing") == "bea: it has no alignments"
    exporter.names, exporter.missing, exporter.sentence = (), ("bea: cannot be read",), ""
    press(dialog, "back").click()
    export(qtbot, dialog, exporter)
    assert "Nothing was exported" in text(dialog, "exportEndFound")
    assert text(dialog, "missing") == "bea: cannot be read"
    for name in ("openReport", "openFolder", "copyPath", "copySentence"):
        assert press(dialog, name).isHidden()


def test_without_formats_or_folder_nothing_can_be_exported(dialog: ExportDialog) -> None:
    for name in ("report", "csv"):
        box(dialog, name).click()
    assert not press(dialog, "export").isEnabled()
    assert "nothing is ticked" in text(dialog, "exportTask")
    box(dialog, "zip").click()
    assert press(dialog, "export").isEnabled()
    child(dialog, PathField).set_path("")
    assert not press(dialog, "export").isEnabled()
    assert text(dialog, "exportTask") == "Choose the folder to export to."
    assert not child(dialog, QLabel, "folderFound").isVisible()


def test_a_folder_that_cannot_be_created_is_refused_beside_it(
    qtbot: QtBot, dialog: ExportDialog, tmp_path: Path
) -> None:
    made = f"The export will create the folder {dialog.target.name} there."
    qtbot.waitUntil(lambda: text(dialog, "folderFound") == made)
    field, file = child(dialog, PathField), tmp_path / "file"
    file.touch()
    field.set_path(str(file / "folder"))
    qtbot.waitUntil(lambda: f"{file} is a file" in text(dialog, "folderFound"))
    assert text(dialog, "exportTask") == "Choose another folder to export to."
    assert not press(dialog, "export").isEnabled()
    earlier = tmp_path / "earlier" / dialog.target.name
    earlier.mkdir(parents=True)
    (earlier / "parameters.csv").touch()
    field.set_path(str(earlier.parent))
    qtbot.waitUntil(lambda: text(dialog, "folderFound").endswith("there will be replaced."))
    assert press(dialog, "export").isEnabled()


def test_a_failure_is_reported_and_can_be_tried_again(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    exporter.failure = "cannot write /x: No space left on device"
    exporter.may_end.set()
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: "No space left on device" in text(dialog, "exportEndFound"))
    assert "try again" in text(dialog, "exportEndFound")
    exporter.failure = ""
    qtbot.waitUntil(press(dialog, "export").isEnabled)
    export(qtbot, dialog, exporter)
    assert text(dialog, "exportEndFound").startswith("2 files in ")


def test_a_name_is_no_markup(qtbot: QtBot, dialog: ExportDialog, exporter: Exporter) -> None:
    exporter.doing = "1 of 3: <b>W, Report"
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: text(dialog, "doing") == f"{exporter.doing}…")
    assert child(dialog, QLabel, "doing").textFormat() == Qt.TextFormat.PlainText


def test_esc_cancels_the_export_and_says_so_and_closes_only_then(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: bool(exporter.asked))
    for _ in range(2):
        QTest.keyClick(dialog, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: "Cancelled" in text(dialog, "exportEndFound"))
    assert "earlier exports are unchanged" in text(dialog, "exportEndFound")
    assert dialog.isVisible()
    QTest.keyClick(dialog, Qt.Key.Key_Escape)
    assert not dialog.isVisible()


def test_closing_while_it_runs_cancels_and_then_closes(
    qtbot: QtBot, dialog: ExportDialog, exporter: Exporter
) -> None:
    press(dialog, "export").click()
    qtbot.waitUntil(lambda: bool(exporter.asked))
    with qtbot.waitSignal(dialog.rejected):
        dialog.close()
    assert not [t for t in threading.enumerate() if t.name == "handcal job"]


def test_every_choice_has_a_letter_of_its_own(dialog: ExportDialog) -> None:
    found = letters(dialog, is_shown=True)
    boxes = dialog.findChildren(QCheckBox)
    assert all("&" in box.text() for box in boxes)
    assert len(set(found)) == len(found)


def test_a_real_session_is_exported(qtbot: QtBot, record: SessionRecord, tmp_path: Path) -> None:
    dialog = ExportDialog(
        "one",
        ExportSettings(("csv", "unity", "yaml")),
        tmp_path / "out",
        lambda *where: Exported(export_session(record, *where)),
    )
    qtbot.addWidget(dialog)
    dialog.show()
    with qtbot.waitSignal(dialog.succeeded, timeout=20_000):
        dialog.start()
    assert sorted(path.name for path in (tmp_path / "out" / "one").iterdir()) == [
        "calibration.yaml",
        "parameters.csv",
        "trials.csv",
        "unity.json",
    ]
