from pytestqt.qtbot import QtBot

from handcal_gui.widgets.number_label import UNKNOWN, NumberLabel


def test_it_shows_and_tells_its_text(qtbot: QtBot) -> None:
    label = NumberLabel("age", "99.9 ms", "How old it is")
    qtbot.addWidget(label)
    assert label.text() == UNKNOWN
    label.setText("12.3 ms")
    assert label.text() == label.accessibleName() == "12.3 ms"
    label.setText(UNKNOWN)
    assert label.text() == UNKNOWN
