"""What several commands need of `handeyed solve`, solved once."""

import pytest

from tests.daemon.cli.running import Ran, handeyed
from tests.daemon.cli.sessions import with_corners


@pytest.fixture(scope="session")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    """`handeyed solve --json` of the session with corners: accepted, X near FLANGE_T_CAMERA."""
    ran = handeyed("solve", with_corners(tmp_path_factory.mktemp("solved") / "cell"), "--json")
    assert ran.status == 0
    return ran
