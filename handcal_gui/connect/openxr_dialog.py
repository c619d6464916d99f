"""The dialog that gives the calibration of the session shown to all OpenXR programs."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QCheckBox, QDialog, QWidget

from handcal.export.openxr import install_layer, layer_status, remove_layer, use_calibration
from handcal.session.session import SessionRecord
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.widgets.fields import button, main_button, paragraph
from handcal_gui.widgets.layouts import hbox, vbox

_ABOUT = tr(
    "Every OpenXR program that you start on this computer then loads handcal's layer, which gives "
    "it the calibrated eyes of this wearer; Remove ends it for all."
)
_REFRESH_MS = 1000


class OpenxrDialog(QDialog):
    """Installs the layer, puts the calibration in force, and shows what the layer does with it.

    Parameters
    ----------
    record : SessionRecord
    """

    def __init__(self, record: SessionRecord, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("openxrDialog")
        self.setWindowTitle(tr("OpenXR programs"))
        keep = QCheckBox(tr("&Keep it until it is replaced or the rig changes, not for 12 hours"))
        keep.setObjectName("keepOpenxr")
        self._status = paragraph("openxrStatus")
        self._status.setMinimumWidth(60 * SPACING_PX)
        self._use = main_button("useOpenxr", tr("&Use for every OpenXR program on this computer"))
        self._remove = button("removeOpenxr", tr("&Remove"))
        close = button("close", tr("&Close"))

        def use() -> None:
            is_kept = keep.isChecked()  # now, and not in the job's thread

            def act() -> None:
                install_layer()
                use_calibration(record, keep=is_kept)

            self._start(act)

        self._job = LatestJob(_do)
        self._job.answered.connect(lambda _, lines: self._show("\n".join(lines)))
        self._job.failed.connect(self._show)
        self._refresh = QTimer(self, singleShot=True, interval=_REFRESH_MS)
        self._refresh.timeout.connect(lambda: self._job.ask(None))
        self._use.clicked.connect(use)
        self._remove.clicked.connect(lambda: self._start(remove_layer))
        close.clicked.connect(self.reject)
        self.finished.connect(self.stop)
        vbox(
            paragraph("openxrAbout", _ABOUT),
            keep,
            self._status,
            1,
            hbox(self._remove, 1, close, self._use, spacing=SPACING_PX),
            on=self,
            margins=2 * SPACING_PX,
            spacing=2 * SPACING_PX,
        )
        self._job.ask(None)

    def stop(self) -> None:
        """End what runs; safe to call twice."""
        self._refresh.stop()
        self._job.stop()

    def _start(self, action: Callable[[], object]) -> None:
        self._refresh.stop()  # a question for the status would replace it
        self._use.setEnabled(False)
        self._remove.setEnabled(False)
        self._job.ask(action)

    def _show(self, said: str) -> None:
        self._status.setText(said)
        self._use.setEnabled(True)
        self._remove.setEnabled(True)
        self._refresh.start()


def _do(action: Callable[[], object] | None) -> tuple[str, ...]:
    """Act, and return the status."""
    if action is not None:
        action()
    return layer_status().lines
