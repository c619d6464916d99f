"""The list of paired headsets: renamed in place, or revoked."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QMessageBox,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from handcal.core.errors import HandcalError
from handcal.link.pairing import Pairing, Pairings
from handcal_gui.app.theme import SPACING_PX, flat_header, number_font
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import button, paragraph, plain_message
from handcal_gui.widgets.layouts import hbox, vbox

_NAME, _DEVICE = range(2)


class PairedDevices(QWidget):
    """Shows the paired headsets, the connected one marked, with their names to edit.

    Parameters
    ----------
    pairings : Pairings

    Attributes
    ----------
    failed : Signal(str)
        The reason why a change was not made.
    """

    failed = Signal(str)

    def __init__(self, pairings: Pairings, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._pairings = pairings
        self._shown: tuple[tuple[Pairing, ...], str] = (), ""
        self._is_filling = False
        self._table = QTableWidget(0, 2)
        self._table.setObjectName("pairedDevices")
        self._table.setAccessibleName(tr("Paired headsets"))
        self._table.setHorizontalHeaderLabels([tr("Name"), tr("Device")])
        self._table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self._table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self._table.setTabKeyNavigation(False)
        self._table.setShowGrid(False)
        self._table.setMinimumHeight(10 * SPACING_PX)
        self._table.verticalHeader().hide()
        across = self._table.horizontalHeader()
        flat_header(across)
        across.setSectionResizeMode(_NAME, QHeaderView.ResizeMode.Stretch)
        across.setSectionResizeMode(_DEVICE, QHeaderView.ResizeMode.ResizeToContents)
        self._empty = paragraph(
            "noDevices", tr("None yet. Headsets appear here once they are paired.")
        )
        self._empty.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._rename = button("renameDevice", tr("Rena&me"), tr("Rename the chosen headset"))
        self._revoke = button(
            "revokeDevice",
            tr("Re&voke…"),
            tr("Revoke the chosen headset"),
            tr("It can then no longer connect"),
        )
        self._table.itemChanged.connect(self._take_name)
        self._table.itemSelectionChanged.connect(self._refresh)
        self._rename.clicked.connect(self._edit_name)
        self._revoke.clicked.connect(self._ask_to_revoke)
        vbox(
            self._empty,
            (self._table, 1),
            hbox(1, self._rename, self._revoke, spacing=SPACING_PX),
            on=self,
            margins=0,
            spacing=SPACING_PX // 2,
        )
        self._refresh()

    def show_devices(self, connected_id: str) -> None:
        """Show the devices paired now, unless a name is being edited; mark the connected one."""
        if (self._paired(), connected_id) != self._shown and not self._is_editing():
            self._fill(connected_id)

    def _paired(self) -> tuple[Pairing, ...]:
        return tuple(one for one in self._pairings.all if one.device_id)

    def _fill(self, connected_id: str) -> None:
        chosen, devices = self._chosen(), self._paired()
        self._shown = devices, connected_id
        self._is_filling = True
        self._table.setRowCount(len(devices))
        for row, one in enumerate(devices):
            name = QTableWidgetItem(one.name or tr("Without a name"))
            is_connected = one.device_id == connected_id
            device = QTableWidgetItem(
                tr("{}, connected").format(one.device_id) if is_connected else one.device_id
            )
            device.setFlags(Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable)
            device.setFont(number_font())
            self._table.setItem(row, _NAME, name)
            self._table.setItem(row, _DEVICE, device)
        self._is_filling = False
        for row, one in enumerate(devices):
            if chosen is not None and one.device_id == chosen.device_id:
                self._table.selectRow(row)
        self._refresh()

    def _is_editing(self) -> bool:
        return self._table.state() == QAbstractItemView.State.EditingState

    def _chosen(self) -> Pairing | None:
        rows = self._table.selectionModel().selectedRows()
        return self._shown[0][rows[0].row()] if rows else None

    def _edit_name(self) -> None:
        item = self._table.item(self._table.currentRow(), _NAME)
        if item is not None:
            self._table.editItem(item)

    def _take_name(self, item: QTableWidgetItem) -> None:
        if self._is_filling or item.column() != _NAME:
            return
        one = self._shown[0][item.row()]
        self._change(lambda: self._pairings.rename(one.device_id, item.text().strip()))

    def _ask_to_revoke(self) -> None:
        one = self._chosen()
        if one is None:
            return
        buttons = QMessageBox.StandardButton
        question = tr(
            "Revoke {}? Its session ends, and it connects again only after it has been "
            "paired again."
        ).format(one.name or one.device_id)
        if QMessageBox.question(self, tr("Revoke"), plain_message(question)) == buttons.Yes:
            self._change(lambda: self._pairings.revoke(one.device_id))

    def _change(self, change: Callable[[], None]) -> None:
        """Change the pairings, and show what they are then."""
        try:
            change()
        except (HandcalError, ValueError) as error:
            self.failed.emit(str(error))
        self._fill(self._shown[1])

    def _refresh(self) -> None:
        has_devices = bool(self._shown[0])
        self._table.setVisible(has_devices)
        self._empty.setVisible(not has_devices)
        for one in (self._rename, self._revoke):
            one.setVisible(has_devices)
            one.setEnabled(self._chosen() is not None)
