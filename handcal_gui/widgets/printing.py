"""Printing with Qt's own dialog, to a printer or a PDF file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QBuffer, QIODeviceBase
from PySide6.QtGui import QPagedPaintDevice, QPdfWriter
from PySide6.QtPrintSupport import QPrintDialog, QPrinter
from PySide6.QtWidgets import QDialog, QMessageBox, QWidget

from handcal.core.errors import FileError
from handcal.io.files import write_atomic
from handcal_gui.app.translation import tr
from handcal_gui.widgets.brief import show_briefly
from handcal_gui.widgets.fields import plain_message
from handcal_gui.widgets.sentence import sentence

PrintTo = Callable[[QPagedPaintDevice], object]


def ask_printer(parent: QWidget, print_to: PrintTo) -> None:
    """Let the user choose a printer or a PDF file, print to it, and say what came of it."""
    printer = QPrinter(QPrinter.PrinterMode.HighResolution)
    if QPrintDialog(printer, parent).exec() != QDialog.DialogCode.Accepted:
        return
    try:
        show_briefly(parent, print_pages(printer, print_to))
    except FileError as error:
        QMessageBox.warning(parent, tr("Print"), plain_message(sentence(str(error))))


def print_pages(printer: QPrinter, print_to: PrintTo) -> str:
    """Print to the printer or the PDF file that is chosen; return a message.

    Raises
    ------
    FileError
        If it failed: Qt itself says nothing when a file cannot be written.
    """
    path = printer.outputFileName()
    if path:
        try:
            write_atomic(Path(path), _pdf(printer, print_to))
        except FileError as error:
            raise FileError(tr("{}; choose another file").format(error)) from error
        return tr("Saved as {}").format(path)
    print_to(printer)
    name = printer.printerName()
    if printer.printerState() in (QPrinter.PrinterState.Error, QPrinter.PrinterState.Aborted):
        failed = tr("{} did not print; see whether it is connected, or print to a PDF file")
        raise FileError(failed.format(name))
    return tr("Sent to {}").format(name)


def _pdf(printer: QPrinter, print_to: PrintTo) -> bytes:
    """Return the pages as a PDF file, with the layout chosen for the printer."""
    buffer = QBuffer()
    buffer.open(QIODeviceBase.OpenModeFlag.WriteOnly)
    writer = QPdfWriter(buffer)
    writer.setResolution(printer.resolution())
    writer.setPageLayout(printer.pageLayout())
    writer.setPageRanges(printer.pageRanges())
    print_to(writer)
    return bytes(buffer.data().data())
