"""Body of POST /sweeps."""

from calibration.documents.validation import Document
from daemon.config.settings import DeviceName
from daemon.model.requests import examples


class SweepRequest(Document):
    """A sweep of a line profiler. `scanner`: name of one of [scanners]; [scanner] without it."""

    model_config = examples({}, {"scanner": "laser"})

    scanner: DeviceName | None = None
