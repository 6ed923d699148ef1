"""The `target` of a JSON or TOML file, and the target as TOML."""

from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document


class TargetFile(Document):
    """The part of a session.json, plan.json or handeyed.toml that `handeyed target` reads."""

    target: TargetDocument


def toml_snippet(target: TargetDocument) -> str:
    """The [target] section of the daemon's settings."""
    values = target.model_dump(exclude_none=True)
    return "\n".join(["[target]", *(f"{key} = {_toml(value)}" for key, value in values.items())])


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else f"{value}"
