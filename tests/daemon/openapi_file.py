"""Writes docs/openapi.json: python -m tests.daemon.openapi_file"""

import json
from pathlib import Path

from daemon.api.app import routes
from extensions.installed import INSTALLED


def main() -> None:
    file = Path(__file__).parents[2] / "docs" / "openapi.json"
    file.write_text(json.dumps(routes(None, INSTALLED).openapi(), indent=1) + "\n")


if __name__ == "__main__":
    main()
