"""The last step: the rig's name, what is known of it, and its use."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel, QLineEdit, QPushButton
from pytestqt.qtbot import QtBot

from handcal.camera.settings import RealSenseSettings
from handcal.core.types import RIG_PARTS, Origin
from handcal.rig.example import example_rig
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.project_folder import ProjectFolder
from handcal_gui.rig.result_page import ResultPage
from handcal_gui.widgets.times import local_time
from tests.gui.helpers import child
from tests.gui.rig.wizard_steps import findings

ORIGIN = Origin("as told", "now", 3, 0.1, "good", "as told", ("a",), np.eye(1))


@pytest.fixture
def project(tmp_path: Path) -> RigProject:
    return RigProject(ProjectFolder(tmp_path), RealSenseSettings())


def test_what_is_of_the_initial_rig_is_named_and_not_ticked(
    qtbot: QtBot, project: RigProject
) -> None:
    page = ResultPage(project)
    qtbot.addWidget(page)
    apart, screen = "Distance of the viewpoints", "Left: distance of the virtual screen"
    assert findings(page)[apart] == ("63 mm, as in the initial rig", "")
    project.use_rig(replace(project.rig, origins={"left": ORIGIN}))
    assert findings(page)[apart] == ("63 mm, partly as in the initial rig", "")
    assert findings(page)[screen] == ("2 m", "Good")
    project.use_rig(replace(project.rig, origins={"left": ORIGIN, "right": ORIGIN}))
    assert findings(page)[apart] == ("63 mm", "Good")
    left = replace(example_rig().eyes["left"], z_C0_S_m=20.0)
    project.use_rig(replace(example_rig(), eyes={**example_rig().eyes, "left": left}))
    assert findings(page)[screen] == ("20 m", "Doubtful"), "of the initial rig, too"


def test_it_says_how_to_go_on_and_why_a_rig_cannot_be_used_yet(
    qtbot: QtBot, project: RigProject, tmp_path: Path
) -> None:
    page = ResultPage(project)
    qtbot.addWidget(page)
    said, use = child(page, QLabel, "savedRigFound"), child(page, QPushButton, "useRig")
    assert "Solve these steps, or save the rig file to use it as it is." in said.text()
    assert not use.isEnabled()
    assert use.toolTip() == "Save the rig file first"
    project.use_rig(replace(project.rig, origins=dict.fromkeys(RIG_PARTS, ORIGIN)))
    assert said.text().endswith("Save the rig file to use it.")
    project.save_rig_as(tmp_path / "ours.yaml")
    assert use.isEnabled()
    assert not use.toolTip()
    assert "ours.yaml; " in said.text(), "what is doubtful or not known stays in sight"


def test_a_failed_acceptance_is_shown_as_a_failure(
    qtbot: QtBot, project: RigProject, tmp_path: Path
) -> None:
    page = ResultPage(project)
    qtbot.addWidget(page)
    left = replace(project.rig.eyes["left"], z_C0_S_m=20.0)
    project.use_rig(replace(project.rig, eyes={**project.rig.eyes, "left": left}))
    project.note_accepted("the rig fails: left", is_passed=False)
    page.enter()
    assert [sign for _, sign in findings(page).values()][:2] == ["Failed", "Doubtful"]
    project.use_rig(replace(example_rig(), origins=dict.fromkeys(RIG_PARTS, ORIGIN)))
    project.note_accepted("the rig fails: left", is_passed=False)
    page.enter()
    assert next(iter(findings(page))) == "Acceptance"
    assert findings(page)["Acceptance"][1] == "Failed"
    said, sign = child(page, QLabel, "savedRigFound"), child(page, QLabel, "savedRigHealth")
    assert said.text().startswith("1 failed; 5 not known or not made. Follow the advice under")
    assert sign.accessibleName() == "Problem"
    project.note_accepted("the rig passes", is_passed=True)
    page.enter()
    assert findings(page)["Acceptance"][1] == "Good"
    assert said.text().startswith("5 not known or not made; none doubtful. Save")
    project.note_accepted("the rig fails: left", is_passed=False)
    project.save_rig_as(tmp_path / "ours.yaml")
    assert said.text().endswith("Follow the advice under Acceptance, then accept the rig again.")


def test_checks_made_elsewhere_have_a_link_to_the_manual_and_no_shell_command(
    qtbot: QtBot, project: RigProject
) -> None:
    read: list[str] = []
    page = ResultPage(project, read.append)
    qtbot.addWidget(page)
    told = findings(page)
    assert told["Depth check"] == told["Display check"] == ("Not made yet", "Not known")
    assert not [found for found, _ in told.values() if "handcal rig" in found]
    child(page, QLabel, "howToCheck").linkActivated.emit("docs/tutorial.md#7")
    assert read == ["docs/tutorial.md#7"]


def test_times_are_shown_as_everywhere(qtbot: QtBot, project: RigProject) -> None:
    page = ResultPage(project)
    qtbot.addWidget(page)
    made = "2026-11-26T08:29:24Z"
    project.use_rig(replace(project.rig, origins={"left": replace(ORIGIN, made=made)}))
    found, _ = findings(page)["Calibration of the left display"]
    assert local_time(made) in found
    assert "T08" not in found


def test_a_missing_name_is_said_beside_the_field_at_once(qtbot: QtBot, project: RigProject) -> None:
    page = ResultPage(project)
    qtbot.addWidget(page)
    page.show()
    name, problem = child(page, QLineEdit, "rigName"), child(page, QLabel, "rigNameProblem")
    before = name.text()
    for text in ("", " ", "a\x07"):
        name.setText(text)
        assert problem.isVisible()
        assert not page.main.isEnabled()
        name.editingFinished.emit()
        assert name.text() == text, "it is not replaced unasked"
        assert project.rig.name == before
    name.setText("Rig 7")
    assert not problem.isVisible()
    assert page.main.isEnabled()
