"""Printing: to a file, all of it or none, and a failure is said."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QMarginsF
from PySide6.QtGui import QPagedPaintDevice, QPageLayout, QPageSize, QTextDocument
from PySide6.QtPrintSupport import QPrintDialog, QPrinter
from PySide6.QtWidgets import QDialog, QMessageBox, QWidget
from pytestqt.qtbot import QtBot

from handcal.core.errors import FileError
from handcal_gui.widgets.printing import ask_printer, print_pages
from tests.gui.helpers import text


def hello(device: QPagedPaintDevice) -> None:
    document = QTextDocument()
    document.setPlainText("hello")
    document.print_(device)


def printer_to(path: Path) -> QPrinter:
    printer = QPrinter(QPrinter.PrinterMode.HighResolution)
    printer.setOutputFileName(str(path))
    return printer


@pytest.mark.usefixtures("qapp")
def test_a_file_has_the_layout_that_was_chosen(tmp_path: Path) -> None:
    printer = printer_to(tmp_path / "a.pdf")
    size, across = QPageSize(QPageSize.PageSizeId.A5), QPageLayout.Orientation.Landscape
    printer.setPageLayout(QPageLayout(size, across, QMarginsF()))
    assert print_pages(printer, hello) == f"Saved as {tmp_path / 'a.pdf'}"
    made = (tmp_path / "a.pdf").read_bytes()
    assert made.startswith(b"%PDF")
    assert b"/MediaBox [0 0 595" in made


def test_a_file_that_cannot_be_written_is_said(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    missing = tmp_path / "missing" / "a.pdf"
    with pytest.raises(FileError, match=r"cannot write .*a\.pdf.*; choose another file"):
        print_pages(printer_to(missing), hello)
    path = tmp_path / "a.pdf"

    def choose(dialog: QPrintDialog) -> QDialog.DialogCode:
        dialog.printer().setOutputFileName(str(path))
        return QDialog.DialogCode.Accepted

    told: list[str] = []
    monkeypatch.setattr(QPrintDialog, "exec", choose)
    monkeypatch.setattr(QMessageBox, "warning", lambda _parent, _title, text: told.append(text))
    parent = QWidget()
    qtbot.addWidget(parent)
    parent.show()
    ask_printer(parent, hello)
    assert path.exists()
    assert not told
    assert text(parent, "brief") == f"Saved as {path}"
    path = missing
    ask_printer(parent, hello)
    assert len(told) == 1
    assert "choose another file" in told[0]
