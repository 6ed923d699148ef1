"""setup.json in the backup of `handeyed robot setup`: what the installation replaced, from which it is undone."""

from typing import Literal

from calibration.documents.validation import Document


class SetupRecordDocument(Document):
    """The whole of setup.json. The files and configurations that it names lie beside it."""

    heading = "setupjson"

    version: Literal[1]
    """Version of the format."""
    files: dict[str, bool]
    """Files written; true where one was there before: it lies below HOME."""
    instances: list[tuple[str, str, str]]
    """Configuration instances that were loaded: domain, type, name."""
    symbols: dict[str, str]
    """Values of RAPID symbols before, as RAPID writes them."""
    configuration: list[str]
    """Configuration files saved before, beside this one."""
