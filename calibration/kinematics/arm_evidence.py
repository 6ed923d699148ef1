"""What the numbers of each listed arm were compared with, for people who read the list."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

_EVIDENCE: dict[str, tuple[Literal["checked", "doubtful"], str]] = json.loads(
    Path(__file__).with_name("abb_arms_evidence.json").read_text("utf-8")
)


@dataclass(frozen=True)
class Evidence:
    """What an arm's numbers were compared with. `state`: checked, doubtful, or not checked against a second source."""

    state: Literal["checked", "doubtful", "single source"]
    source: str


def evidence_of(name: str) -> Evidence:
    """The evidence for an arm of this list."""
    if name not in _EVIDENCE:
        return Evidence("single source", "ABB.Presets")
    state, source = _EVIDENCE[name]
    return Evidence(state, f"ABB.Presets; {source}")
