"""Asks the daemon at argv[1] with the client that openapi-python-client has generated into the folder argv[2]."""

import json
import sys
from importlib import import_module
from typing import Any

url, folder = sys.argv[1:]
sys.path.insert(0, folder)


def operation(name: str) -> Any:
    return import_module(f"generated.api.{name}").sync


with import_module("generated").Client(base_url=url, raise_on_unexpected_status=True) as client:
    health = operation("health.get_health")(client=client)
    listed = operation("calibrations.list_calibrations")(client=client)
    one = operation("calibrations.get_calibration")(client=client, calibration_id=listed.calibrations[0].id)
answer = {
    "status": health.status,
    "listed": [each.id for each in listed.calibrations],
    "translation_mm": one.flange_t_camera.translation_mm,
}
print(json.dumps(answer))
