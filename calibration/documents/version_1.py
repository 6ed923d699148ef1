"""Reads calibration.json of version 1 as version 2: what it does not hold is null or empty."""

from typing import Any

from calibration.sentences.sentence import AS_WRITTEN


def upgrade_calibration(data: dict[str, Any]) -> dict[str, Any]:
    """The content of a calibration.json of version 1 as one of version 2; `data` is left as it is.

    Its sentences become those of the id AS_WRITTEN; anything unexpected is left for the model to refuse.
    """
    upgraded = {**data, "schema_version": 2}
    verdict = data.get("verdict")
    if isinstance(verdict, dict) and isinstance(verdict.get("findings"), list):
        upgraded["verdict"] = {**verdict, "findings": [_finding(finding) for finding in verdict["findings"]]}
    return upgraded


def _finding(finding: Any) -> Any:
    if not isinstance(finding, dict):
        return finding
    return {**finding, **_as_written(finding.get("message")), "advice": _as_written(finding.get("fix"))}


def _as_written(text: Any) -> dict[str, Any]:
    return {"id": AS_WRITTEN, "params": {"sentence": text}}
