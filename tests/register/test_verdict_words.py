from typing import get_args

from handcal.core.types import VerdictName
from handcal.register.verdict_words import VERDICT_WORDS


def test_every_verdict_has_a_word_of_its_own() -> None:
    assert set(VERDICT_WORDS) == set(get_args(VerdictName))
    assert len(set(VERDICT_WORDS.values())) == len(VERDICT_WORDS)
