"""setup.json in the backup of `handeyed robot setup`: what the installation replaced, from which it is undone."""

from typing import Literal

from calibration.documents.validation import Document


class SetupRecordDocument(Document):
    """The whole of setup.json. The files and configurations that it names lie beside it."""

    heading = "setupjson"

    version: Literal[1]
    files: dict[str, bool]
    instances: list[tuple[str, str, str]]
    symbols: dict[str, str]
    configuration: list[str]
