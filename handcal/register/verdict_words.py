"""The verdicts in the words that people read: in the window, reports, prints and terminals.

Files that programs read, and the journal, keep the names.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from handcal.core.types import VerdictName

VERDICT_WORDS: Mapping[VerdictName, str] = MappingProxyType(
    {
        "accept": "Good",
        "repeat": "Not yet",
        "keep": "No better than before",
        "implausible": "Impossible",
        "contradicted": "Contradicted",
    }
)
