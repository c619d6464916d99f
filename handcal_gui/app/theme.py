"""Appearance of the program: spacing, colours for light and dark, fonts, icons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Literal

from PySide6.QtCore import QByteArray, QEvent, QObject, QRectF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFont,
    QFontDatabase,
    QGuiApplication,
    QIcon,
    QImage,
    QPainter,
    QPalette,
    QPixmap,
)
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QApplication, QHeaderView, QWidget

from handcal.io.resources import resource_path

SPACING_PX = 8
"""The unit of all margins and gaps, in device-independent pixels; use 0.5, 1, 2 or 3 times it."""


@dataclass(frozen=True, slots=True)
class Colors:
    """Colours with a meaning; colour-blind people can tell them apart, too.

    Everything else comes from the palette.
    """

    live: str
    cursor: str
    """The frozen cursor, and the live hand while it can be confirmed."""
    red: str
    """The live hand beyond the guard's limit, and all errors."""
    good: str
    warning: str
    left: str
    right: str
    """The two eyes in plots."""
    muted: str
    """Less important text and grid lines."""
    canvas: str
    """Background of images and plots."""


_LIGHT = Colors(
    live="#1f6fd6",
    cursor="#8f690c",
    red="#820d0d",
    good="#297848",
    warning="#96610f",
    left="#20686a",
    right="#8e3fa8",
    muted="#5f6772",
    canvas="#ffffff",
)
_DARK = Colors(
    live="#619cfa",
    cursor="#fac747",
    red="#ff6b61",
    good="#7dfab9",
    warning="#feb63f",
    left="#86e5d9",
    right="#d391ea",
    muted="#9aa3ae",
    canvas="#17191c",
)
_CONTRAST = Colors(
    live="#67b9ff",
    cursor="#ffd800",
    red="#f174a1",
    good="#6af991",
    warning="#f1c82b",
    left="#03af9a",
    right="#ffa6ff",
    muted="#e0e0e0",
    canvas="#000000",
)


@dataclass(frozen=True, slots=True)
class _Shades:
    """The colours of a palette; Fusion draws edges a little darker than `box_edge` and `focus`."""

    window: str
    base: str
    stripe: str
    button: str
    text: str
    faint: str
    disabled: str
    accent: str
    link: str
    box_edge: str
    focus: str
    """Edge of what has the focus, and background of text selected in it."""
    on_focus: str


_LIGHT_SHADES = _Shades(
    window="#f3f4f6",
    base="#ffffff",
    stripe="#f6f7f9",
    button="#fbfbfc",
    text="#1b1f24",
    faint=_LIGHT.muted,
    disabled="#858c96",
    accent=_LIGHT.live,
    link=_LIGHT.live,
    box_edge="#b6bcc5",
    focus="#1657b8",
    on_focus="#ffffff",
)
_DARK_SHADES = _Shades(
    window="#26282c",
    base="#1b1d20",
    stripe="#222428",
    button="#3a3d43",
    text="#eceef1",
    faint=_DARK.muted,
    disabled="#8f969f",
    accent="#2f6fb5",
    link=_DARK.live,
    box_edge="#99a1ab",
    focus="#2f8aff",
    on_focus="#101418",
)
_CONTRAST_SHADES = _Shades(
    window="#000000",
    base="#000000",
    stripe="#101010",
    button="#1c1c1c",
    text="#ffffff",
    faint=_CONTRAST.muted,
    disabled="#a8a8a8",
    accent="#0060c0",
    link=_CONTRAST.live,
    box_edge="#ffffff",
    focus="#ffe000",
    on_focus="#000000",
)
_MAIN_BUTTON = "#0b3f8f"
"""Fusion lightens it; white text still has enough contrast."""
_BOXES = (
    "QAbstractSpinBox",
    "QCheckBox",
    "QComboBox",
    "QLineEdit",
    "QListWidget",
    "QPlainTextEdit",
    "QRadioButton",
    "QTableView",
    "QTreeView",
    "Card",
)
"""Widgets whose edges must be visible in the dark theme, too."""
_ITEMS = "QListWidget", "QTableView", "QTreeView"
"""Of these, those whose selection looks the same with the focus and without it."""


def use_theme(theme: Literal["system", "light", "dark", "contrast"]) -> None:
    """Use the system's colours or the chosen ones; call again when the system's change."""
    schemes = {
        "system": Qt.ColorScheme.Unknown,
        "light": Qt.ColorScheme.Light,
        "dark": Qt.ColorScheme.Dark,
        "contrast": Qt.ColorScheme.Dark,
    }
    hints = QGuiApplication.styleHints()
    hints.setColorScheme(schemes[theme])
    # A plain X display has no colour schemes, so the choice itself decides.
    scheme = hints.colorScheme() if theme == "system" else schemes[theme]
    shades = _DARK_SHADES if scheme is Qt.ColorScheme.Dark else _LIGHT_SHADES
    if theme == "contrast":
        shades = _CONTRAST_SHADES
    palette = _palette(shades)
    QApplication.setPalette(palette)
    items, fields = QPalette(palette), QPalette(palette)
    fields.setColor(QPalette.ColorRole.Highlight, QColor(shades.focus))
    fields.setColor(QPalette.ColorRole.HighlightedText, QColor(shades.on_focus))
    buttons, main = QPalette(fields), QPalette(fields)
    for edged in (items, fields, *([buttons] if theme == "contrast" else [])):
        edged.setColor(QPalette.ColorRole.Window, QColor(shades.box_edge))
    for group in (QPalette.ColorGroup.Active, QPalette.ColorGroup.Inactive):
        main.setColor(group, QPalette.ColorRole.Button, QColor(_MAIN_BUTTON))
        main.setColor(group, QPalette.ColorRole.ButtonText, QColor("#ffffff"))
    for special, kinds in (
        (fields, _BOXES),
        (items, (*_ITEMS, "QToolButton") if theme == "contrast" else _ITEMS),
        (buttons, ("QPushButton",)),
        (main, ("MainButton",)),
    ):
        for kind in kinds:  # as text; PySide's stub is wrong
            QApplication.setPalette(special, kind)  # type: ignore[arg-type]
    _THEME.changed.emit()


def is_dark() -> bool:
    """Return whether the dark colours are in use."""
    return QGuiApplication.palette().window().color().lightness() < 128


def colors() -> Colors:
    """Return the colours of the current scheme, which `follow_theme` observes."""
    if QGuiApplication.palette().window().color() == QColor(_CONTRAST_SHADES.window):
        return _CONTRAST
    return _DARK if is_dark() else _LIGHT


def follow_theme(widget: QWidget, redraw: Callable[[], object]) -> None:
    """Call a method of a widget now and after each change of the widget's palette."""
    _PaletteWatch(widget).changed.connect(redraw)
    redraw()


def set_style(widget: QWidget, sheet: str) -> None:
    """Give a widget a style sheet in place of its former one, and again after a change of theme.

    Qt does not update the colours of a widget that has one.
    """
    style = widget.findChild(_Style, options=Qt.FindChildOption.FindDirectChildrenOnly)
    if style is None:
        style = _Style(widget)
        _THEME.changed.connect(style.set)
    if style.sheet != sheet:
        style.sheet = sheet
        style.set()


def flat_header(header: QHeaderView) -> None:
    """Make a table's header look like its cells, with muted text."""
    set_style(
        header,
        "QHeaderView { background: palette(base); }"
        "QHeaderView::section { background: transparent; border: 0; padding: 2px 4px;"
        " color: palette(placeholder-text); }",
    )


def number_font(scale: float = 1.0) -> QFont:
    """Return a font with digits of equal width, so that changing numbers do not jump."""
    font = QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)
    font.setPointSizeF(scale * QGuiApplication.font().pointSizeF())
    return font


def scale_font(widget: QWidget, scale: float, *, is_bold: bool = False) -> None:
    """Scale the size of a widget's text."""
    font = widget.font()
    font.setPointSizeF(scale * font.pointSizeF())
    font.setBold(is_bold)
    widget.setFont(font)


def icon(name: str, color: str = "") -> QIcon:
    """Return the icon ``resources/icons/NAME.svg``, in the palette's text colour or another."""
    result = QIcon()
    palette = QGuiApplication.palette()
    text, disabled = (
        palette.color(group, QPalette.ColorRole.WindowText)
        for group in (QPalette.ColorGroup.Active, QPalette.ColorGroup.Disabled)
    )
    for mode, shade in (
        (QIcon.Mode.Normal, QColor(color) if color else text),
        (QIcon.Mode.Disabled, disabled),
    ):
        tinted = _svg(name).replace(b"currentColor", shade.name().encode())
        for size_px in (16, 24, 32, 48, 64):
            result.addPixmap(QPixmap.fromImage(_draw(tinted, size_px)), mode)
    return result


@cache
def _svg(name: str) -> bytes:
    return resource_path(f"icons/{name}.svg").read_bytes()


class _Theme(QObject):
    """Emits `changed` after each change of the theme."""

    changed = Signal()


_THEME = _Theme()


class _Style(QObject):
    """Sets its parent's style sheet; deleted with it, and its connection, too."""

    sheet = ""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self._widget = widget

    def set(self) -> None:
        self._widget.setStyleSheet("")
        self._widget.setStyleSheet(self.sheet)


class _PaletteWatch(QObject):
    """Emits `changed` at each event of its parent that tells of a palette."""

    changed = Signal()

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        widget.installEventFilter(self)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.PaletteChange:
            self.changed.emit()
        return False


def _palette(shades: _Shades) -> QPalette:
    palette = QPalette(QColor(shades.button), QColor(shades.window))
    roles = QPalette.ColorRole
    for role, color in (
        (roles.Base, shades.base),
        (roles.AlternateBase, shades.stripe),
        (roles.ToolTipBase, shades.button),
        (roles.PlaceholderText, shades.faint),
        (roles.Accent, shades.accent),
        (roles.Highlight, shades.accent),
        (roles.HighlightedText, "#ffffff"),
        (roles.Link, shades.link),
    ):
        palette.setColor(role, QColor(color))
    for role in (roles.Text, roles.WindowText, roles.ButtonText, roles.ToolTipText):
        palette.setColor(role, QColor(shades.text))
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor(shades.disabled))
    for role in (roles.PlaceholderText, roles.Highlight):  # with this, sliders are filled
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor(shades.disabled))
    return palette


@lru_cache(maxsize=512)  # a quarter of the time of opening a window
def _draw(svg: bytes, size_px: int) -> QImage:
    image = QImage(size_px, size_px, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    QSvgRenderer(QByteArray(svg)).render(painter, QRectF(0, 0, size_px, size_px))
    painter.end()
    return image
