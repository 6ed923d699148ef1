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


def ambiguity_note(target: TargetDocument) -> str | None:
    """A warning when the target looks the same rotated by 180 degrees; else None."""
    match target.kind:
        case "chessboard" if (target.columns + target.rows) % 2 == 0:
            advice = "make one of columns and rows odd, the other even"
        case "circles" if target.origin is None and (target.layout == "symmetric" or target.rows % 2 == 1):
            advice = "use --large-origin, or an asymmetric grid with an even number of rows"
        case _:
            return None
    return f"This target looks the same turned by 180 deg, so a turned picture cannot be recognised: {advice}."


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else f"{value}"
