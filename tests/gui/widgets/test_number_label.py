import pytest
from PySide6.QtWidgets import QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.widgets.number_label import UNKNOWN, NumberLabel


@pytest.fixture
def around(qtbot: QtBot) -> QWidget:
    around = QWidget()
    qtbot.addWidget(around)
    return around


@pytest.fixture
def label(around: QWidget, qtbot: QtBot) -> NumberLabel:
    label = NumberLabel("age", "99.9 ms", "How old it is")
    QVBoxLayout(around).addWidget(label)
    around.show()
    qtbot.waitExposed(around)
    qtbot.wait(20)
    return label


def test_it_shows_and_tells_its_text(label: NumberLabel) -> None:
    unknown = label.grab().toImage()
    assert label.text() == UNKNOWN
    label.setText("12.3 ms")
    assert label.text() == label.accessibleName() == "12.3 ms"
    assert label.grab().toImage() != unknown
    label.setText(UNKNOWN)
    assert label.grab().toImage() == unknown
