"""The choice of the plan that a session follows, and of the eyes that the wearer sees with."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from handcal.core.types import EYES, Eye, PlanName
from handcal.station.settings import StationSettings
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import choice, fill_row

_PLANS: dict[PlanName, str] = {"recommended": tr("Recommended"), "paper": tr("As in the paper")}
_PLAN_HELP = tr(
    "Recommended: the hand is raised once; the cursors are placed where they are most\n"
    "informative, and each eye is verified. The steps run automatically.\n"
    "As in the paper: the cursor is the hand where it is held; you choose the eyes in the guide."
)
_EYES: dict[str, str] = {
    "both": tr("Both eyes"),
    "left": tr("Left eye only"),
    "right": tr("Right eye only"),
}
_USABLE: dict[str, tuple[Eye, ...]] = {"both": EYES, "left": ("left",), "right": ("right",)}


class PlanField(QWidget):
    """Plan and usable eyes.

    Attributes
    ----------
    changed : Signal()
    """

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._plan = choice("plan", tr("Plan"), _PLANS, _PLAN_HELP)
        self._eyes = choice(
            "usableEyes", tr("Eyes"), _EYES, tr("Only one, if the wearer sees with one eye.")
        )
        fill_row(self, self._plan, self._eyes, grows=self._eyes)
        self.setFocusProxy(self._plan)
        for field in (self._plan, self._eyes):
            field.currentIndexChanged.connect(self._on_changed)

    def show_settings(self, settings: StationSettings) -> None:
        """Show the plan of a station."""
        self._plan.setCurrentIndex(self._plan.findData(settings.plan.name))
        name = next(
            key for key, eyes in _USABLE.items() if set(eyes) == {*settings.plan.usable_eyes}
        )
        self._eyes.setCurrentIndex(self._eyes.findData(name))
        self._eyes.setVisible(settings.plan.name == "recommended")

    def take(self, settings: StationSettings) -> StationSettings:
        """Return settings with the plan shown; the guide chooses the eyes of the paper's plan."""
        name: PlanName = self._plan.currentData()
        is_recommended = name == "recommended"
        usable = _USABLE[self._eyes.currentData()] if is_recommended else EYES
        plan = replace(settings.plan, name=name, usable_eyes=usable, is_automatic=is_recommended)
        return replace(settings, plan=plan)

    def _on_changed(self) -> None:
        self._eyes.setVisible(self._plan.currentData() == "recommended")
        self.changed.emit()
