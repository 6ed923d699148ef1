"""ABB's event messages that the mock writes."""

from collections.abc import Mapping
from types import MappingProxyType

TITLES: Mapping[int, str] = MappingProxyType(
    {
        10020: "Execution error state",
        50026: "Close to singularity",
        50027: "Joint Out of Range",
        50050: "Position outside reach",
        50080: "Position not compatible",
    }
)
"""Titles by number."""
