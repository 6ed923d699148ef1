"""The `target` of a file, whatever else stands in it, and how a person writes it down."""

from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document


class TargetFile(Document):
    """What `handeyed target` needs of a session.json, plan.json or handeyed.toml."""

    target: TargetDocument


def toml_snippet(target: TargetDocument) -> str:
    """The [target] section of the daemon's settings."""
    values = target.model_dump(exclude_none=True)
    return "\n".join(["[target]", *(f"{key} = {_toml(value)}" for key, value in values.items())])


def ambiguity(target: TargetDocument) -> str | None:
    """A sentence when the target looks the same turned by half a turn."""
    match target.kind:
        case "chessboard" if (target.columns + target.rows) % 2 == 0:
            advice = "make one of columns and rows odd, the other even"
        case "circles" if target.origin is None and (target.layout == "symmetric" or target.rows % 2 == 1):
            advice = "use --large-origin, or an asymmetric grid with an even number of rows"
        case _:
            return None
    return f"This target looks the same turned by 180 deg, so a turned picture cannot be told: {advice}."


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else f"{value}"
