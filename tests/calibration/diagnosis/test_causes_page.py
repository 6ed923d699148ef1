"""docs/causes.md lists every cause."""

from pathlib import Path

import numpy as np

from calibration.diagnosis.convention_hypotheses import CONVENTIONS
from calibration.diagnosis.view_hypotheses import CHANGE_CODES
from tests.simulated.fault_kinds import GROSS
from tests.simulated.faults import Noise, simulated_session
from tests.simulated.mixups import MIXUPS

PAGE = Path(__file__).parents[3] / "docs" / "causes.md"


def test_the_page_lists_every_cause() -> None:
    clean = simulated_session(np.random.default_rng(0), 12, Noise(), "eye-in-hand")
    faults = [put(clean, np.random.default_rng(0)) for put in (GROSS | MIXUPS).values()]
    codes = {convention.code for convention in CONVENTIONS} | CHANGE_CODES
    page = PAGE.read_text()
    assert [code for code in sorted(codes.union(*(fault.codes for fault in faults))) if f"`{code}`" not in page] == []
