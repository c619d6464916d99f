"""The known faults can still be made, and the page of promises names what notices each."""

import pytest

from tests.helpers import ROOT
from tests.mutants import MUTANTS, Mutant


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_a_known_fault_can_be_made_and_is_on_the_page(mutant: Mutant) -> None:
    assert mutant.before in (ROOT / mutant.file).read_text("utf-8")
    page = (ROOT / "docs" / "reliability.md").read_text("utf-8")
    campaign = mutant.noticed_by.removeprefix("campaign ")
    if campaign == mutant.noticed_by:
        assert (ROOT / mutant.noticed_by).exists()
    assert f"| {mutant.name} | " in page
    assert f"`{campaign}`" in next(
        line for line in page.splitlines() if line.startswith(f"| {mutant.name} |")
    )
