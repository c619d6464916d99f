"""The dialog in which a headset is paired, its connection is shown, and it is tried."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

from PySide6.QtCore import QRect, QSize, Qt, QTimer
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QInputDialog,
    QLabel,
    QMessageBox,
    QSizePolicy,
    QWidget,
)

from handcal.core.errors import HandcalError, LinkError
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, Rig
from handcal.link.discovery import Announcement
from handcal.link.invitation import Invitation, qr_matrix
from handcal.link.pairing import OFFER_S, Pairings
from handcal.link.reliable import Delivery, Outgoing
from handcal.link.server import HeadsetServer
from handcal.station.checks.display_check import pattern_state, send_pattern
from handcal.station.checks.doctor import Finding, Health
from handcal.station.checks.headset import headset_problem, headset_state
from handcal_gui.app.theme import SPACING_PX, number_font, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.engine.jobs import Job
from handcal_gui.widgets.fields import (
    button,
    make_equally_wide,
    paragraph,
    plain_message,
    with_name,
)
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.result_rows import EYE_NAMES
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.table import Column, Row, Table

_PERIOD_MS = 250
_DELIVERIES = {
    Delivery.PENDING: tr("sent, not acknowledged yet"),
    Delivery.ACKED: tr("acknowledged by the headset"),
    Delivery.FAILED: tr("not acknowledged; try again"),
}

_SEEN: dict[Eye, str] = {"left": tr("The wearer &sees it"), "right": tr("The wearer sees &it")}
"""Of each eye: the same text with another letter."""


class ConnectDialog(QDialog):
    """Invites a headset, and shows what is known of the connected one and nothing else.

    Parameters
    ----------
    server : HeadsetServer
    rig : Rig
        Its displays draw the test square.
    is_calibrating : bool
        If true, the server belongs to a running calibration and is not closed here.
    announces : bool
        Whether the headset can find this computer on the local network.
    """

    def __init__(
        self,
        server: HeadsetServer,
        rig: Rig,
        *,
        is_calibrating: bool,
        announces: bool = True,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("connectDialog")
        self.setWindowTitle(tr("Connect a headset"))
        self._server = server
        self._rig = rig
        self._is_calibrating = is_calibrating
        self._announces = announces
        self._announcing: Job | None = None
        self._invitation: Invitation | None = None
        self._invited_s = 0.0
        self._known: frozenset[str] = frozenset()
        self._qr = QrCode()
        self._code = with_name(QLabel(), "digits", tr("Code to type in the headset"))
        self._code.setFont(number_font())
        scale_font(self._code, 1.6, is_bold=True)
        self._how = paragraph("howToPair")
        self._invite = button("invite", tr("&New code"), tr("Invite another headset"))
        self._state = FindingLine("headset")
        self._attempts = paragraph("attempts")
        self._problem = paragraph("connectProblem")
        self._devices = PairedDevices(server.pairings, self._problem.setText)
        self._squares = {eye: _Square(eye) for eye in EYES}
        self._close = button("close", tr("&Close"))
        self._lay_out()
        self._close.setFocus()  # Enter must not replace a code that is being typed
        self._invite.clicked.connect(self.invite)
        self._close.clicked.connect(self.accept)
        self.finished.connect(self.stop)
        for eye, square in self._squares.items():
            square.send.clicked.connect(lambda _=False, eye=eye: self._send(eye))
        self._timer = QTimer(self, interval=_PERIOD_MS)
        self._timer.timeout.connect(self.refresh)
        self._timer.start()
        if server.connected:
            self._end_invitation(tr("A headset is connected. New code pairs another one."))
        else:
            self.invite()
        self.refresh()

    def invite(self) -> None:
        """Let one new headset pair, by QR code or digits, within ten minutes."""
        try:
            self._invitation = invitation = self._server.invite()
        except LinkError as error:
            self._end_invitation(str(error))
            return
        self._invited_s = time.monotonic()
        self._known = self._paired()
        self._qr.show_text(invitation.text)
        self._qr.show()
        self._code.setText(f"{invitation.digits[:4]} {invitation.digits[4:]}")
        self._how.setText(
            tr(
                "Scan the code with the headset's app. Without a camera: choose this "
                "computer ({}, port {}) in the app and type the digits."
            ).format(invitation.host, invitation.port)
        )
        self._announce(invitation)

    def refresh(self) -> None:
        """Show the state of the link now."""
        link, device = self._server.statistics(), self._server.device
        problem = headset_problem(device, link, self._rig)
        if link.connected:
            health = Health.LIMITED if problem else Health.GOOD
            finding = Finding(tr("Headset"), health, headset_state(device, link), problem)
        else:
            finding = Finding(
                tr("Headset"), Health.LIMITED, tr("no headset is connected yet"), problem
            )
        self._state.show_finding(finding)
        self._devices.show_devices(device.device_id if device and link.connected else "")
        for square in self._squares.values():
            square.show_link(is_connected=link.connected)
        self._watch_invitation()

    def stop(self) -> None:
        """Remove the square, and end what was begun here; safe to call twice."""
        if not self._timer.isActive():
            return
        self._timer.stop()
        self.hide()
        self._server.withdraw()
        if any(square.sent for square in self._squares.values()):
            with suppress(LinkError):  # the calibration has ended
                self._server.send_target(None)
        if self._announcing is not None:
            self._announcing.abandon()
        if not self._is_calibrating:
            self._server.close()

    def _paired(self) -> frozenset[str]:
        return frozenset(one.key for one in self._server.pairings.all if one.device_id)

    def _watch_invitation(self) -> None:
        """Take the code away once it has been used or is too old."""
        if self._invitation is None:
            return
        if self._paired() - self._known:
            self._end_invitation(tr("Paired. From now on the headset connects automatically."))
        elif time.monotonic() - self._invited_s > OFFER_S:
            self._end_invitation(tr("The code has expired. New code makes another one."))
        else:
            attempts = self._server.pairing_attempts
            self._attempts.setText(sentence(str(attempts)))
            self._code.setEnabled(not attempts.is_used_up)

    def _end_invitation(self, why: str) -> None:
        self._invitation = None
        self._qr.hide()
        self._qr.show_text("")
        self._code.clear()
        self._attempts.clear()
        self._how.setText(why)

    def _announce(self, invitation: Invitation) -> None:
        """Announce this computer on the local network until the dialog is closed."""
        if self._announcing is not None or not self._announces:
            return

        def work(progress: Progress) -> None:
            with Announcement((invitation.host, invitation.port)):
                while True:
                    progress.check()
                    time.sleep(0.1)

        self._announcing = Job(work)
        self._announcing.failed.connect(self._problem.setText)
        self._announcing.start()

    def _send(self, eye: Eye) -> None:
        """Show the square to one eye; the other one's is replaced by it."""
        for square in self._squares.values():
            square.forget()
        calibrating = self._is_calibrating
        try:
            sent = send_pattern(self._server, self._rig, eye, is_calibrating=calibrating)
        except LinkError as error:  # the calibration has ended
            self._problem.setText(str(error))
            return
        self._squares[eye].show_sent(sent)

    def _lay_out(self) -> None:
        make_equally_wide(square.send for square in self._squares.values())
        foot = hbox(self._code, 1, self._invite, spacing=SPACING_PX)
        foot.setAlignment(self._invite, Qt.AlignmentFlag.AlignBottom)  # in one line with Close
        left = vbox(self._how, (self._qr, 1), 0, self._attempts, foot, spacing=SPACING_PX)
        right = vbox(
            _heading(tr("Headset")),
            self._state,
            _heading(tr("Test square, 8 cm at 0.5 m")),
            *self._squares.values(),
            _heading(tr("Paired headsets")),
            (self._devices, 1),
            self._problem,
            hbox(1, self._close),
            spacing=SPACING_PX,
        )
        hbox((left, 2), (right, 3), on=self, margins=2 * SPACING_PX, spacing=3 * SPACING_PX)
        self.resize(96 * SPACING_PX, 54 * SPACING_PX)


class _Square(QWidget):
    """The test square of one eye: sent, acknowledged by the headset, seen by the wearer."""

    def __init__(self, eye: Eye) -> None:
        super().__init__()
        self.sent: tuple[Outgoing, ...] = ()
        self._eye = eye
        name = EYE_NAMES[eye]
        self.send = button(f"square-{eye}", tr("Show to &{}").format(name.lower()))
        self._state = paragraph(f"squareState-{eye}")
        self._seen = with_name(
            QCheckBox(_SEEN[eye]),
            f"squareSeen-{eye}",
            tr("{}: the wearer sees it").format(name),
            tr("Tick it when the wearer sees the square with this eye."),
        )
        hbox(self.send, self._seen, (self._state, 1), on=self, margins=0, spacing=SPACING_PX)
        self.forget()

    def forget(self) -> None:
        """Return to a square that is not shown; what the wearer has seen stays."""
        self.sent = ()
        self._state.setText("")
        self._seen.setEnabled(False)

    def show_sent(self, sent: tuple[Outgoing, ...]) -> None:
        """Follow messages that were just sent."""
        self.sent = sent
        self._seen.setChecked(False)
        self.show_link(is_connected=True)

    def show_link(self, *, is_connected: bool) -> None:
        """Show whether the square has arrived; a link that ended takes everything back."""
        self.send.setEnabled(is_connected)
        if not is_connected:
            self.forget()
            self._seen.setChecked(False)
        elif self.sent:
            state = pattern_state(self.sent)
            self._state.setText(_DELIVERIES[state])
            self._seen.setEnabled(state is Delivery.ACKED)


def _heading(text: str) -> QLabel:
    label = QLabel(text)
    scale_font(label, 1.1, is_bold=True)
    return label


_LEAST_PX = 4
"""Size of a module in logical pixels at which a headset's camera reads the code at arm's length."""


class QrCode(QWidget):
    """Shows a text as a QR code; empty without one."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("qrCode")
        self.setAccessibleName(tr("QR code"))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._rows: tuple[tuple[bool, ...], ...] = ()

    def show_text(self, text: str) -> None:
        """Show another text; an empty one shows nothing."""
        self._rows = qr_matrix(text) if text else ()
        self.setAccessibleDescription(text)
        self.update()

    def sizeHint(self) -> QSize:
        """Return the size at which the code is read well."""
        side = 33 * _LEAST_PX + 2 * SPACING_PX
        return QSize(2 * side, 2 * side)

    def minimumSizeHint(self) -> QSize:
        """Return half of that."""
        return self.sizeHint() / 2

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Draw the modules as squares of whole device pixels."""
        if not self._rows:
            return
        painter = QPainter(self)
        ratio = self.devicePixelRatioF()
        painter.scale(1.0 / ratio, 1.0 / ratio)
        count = len(self._rows)
        width, height = round(ratio * self.width()), round(ratio * self.height())
        module = max(1, min(width, height) // count)
        left, top = (width - count * module) // 2, (height - count * module) // 2
        painter.fillRect(QRect(left, top, count * module, count * module), Qt.GlobalColor.white)
        for y, row in enumerate(self._rows):
            for x, is_dark in enumerate(row):
                if is_dark:
                    place = QRect(left + x * module, top + y * module, module, module)
                    painter.fillRect(place, Qt.GlobalColor.black)
        painter.end()


_DEVICE_COLUMNS = (Column(tr("Name"), is_number=False), Column(tr("Device"), is_number=False))


class PairedDevices(QWidget):
    """Shows the paired headsets, the connected one marked; renames and revokes them.

    Parameters
    ----------
    pairings : Pairings
    fail : callable
        Given the reason why a change was not made.
    """

    def __init__(self, pairings: Pairings, fail: Callable[[str], object]) -> None:
        super().__init__()
        self._pairings, self._fail = pairings, fail
        self._connected_id = ""
        self._shown: list[Row] = []
        self._table = Table(
            "pairedDevices",
            tr("Paired headsets"),
            tr("None yet. Headsets appear here once they are paired."),
            chooses="one",
        )
        self._table.setMinimumHeight(10 * SPACING_PX)
        self._rename = button("renameDevice", tr("Rena&me…"), tr("Rename the chosen headset"))
        self._revoke = button(
            "revokeDevice",
            tr("Re&voke…"),
            tr("Revoke the chosen headset"),
            tr("It can then no longer connect"),
        )
        self._table.chosen_changed.connect(self._refresh)
        self._rename.clicked.connect(self._ask_name)
        self._revoke.clicked.connect(self._ask_to_revoke)
        self._refresh()
        foot = hbox(1, self._rename, self._revoke, spacing=SPACING_PX)
        vbox((self._table, 1), foot, on=self, margins=0, spacing=SPACING_PX // 2)

    def show_devices(self, connected_id: str) -> None:
        """Show the devices paired now, and mark the connected one."""
        self._connected_id = connected_id
        connected = tr("{}, connected")
        rows = [
            Row(
                "",
                (
                    one.name or tr("Without a name"),
                    connected.format(one.device_id)
                    if one.device_id == connected_id
                    else one.device_id,
                ),
                key=one,
            )
            for one in self._pairings.all
            if one.device_id
        ]
        if rows != self._shown:
            self._shown = rows
            self._table.show_rows(_DEVICE_COLUMNS, rows)

    def _ask_name(self) -> None:
        [one] = self._table.chosen
        title, label = tr("Rename"), tr("Name of the headset:")
        name, is_given = QInputDialog.getText(self, title, label, text=one.name)
        if is_given:
            self._change(lambda: self._pairings.rename(one.device_id, name.strip()))

    def _ask_to_revoke(self) -> None:
        [one] = self._table.chosen
        question = tr(
            "Revoke {}? Its session ends, and it connects again only after it has been "
            "paired again."
        ).format(one.name or one.device_id)
        answer = QMessageBox.question(self, tr("Revoke"), plain_message(question))
        if answer == QMessageBox.StandardButton.Yes:
            self._change(lambda: self._pairings.revoke(one.device_id))

    def _change(self, change: Callable[[], None]) -> None:
        """Change the pairings, and show what they are then."""
        try:
            change()
        except (HandcalError, ValueError) as error:
            self._fail(str(error))
        self.show_devices(self._connected_id)

    def _refresh(self) -> None:
        for one in (self._rename, self._revoke):
            one.setEnabled(bool(self._table.chosen))
