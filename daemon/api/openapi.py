"""openapi.json: what FastAPI derives, and the bodies and problems it does not see."""

from typing import Any, Literal

from fastapi import FastAPI
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from daemon.api.problems import Problem
from daemon.requests import ApplyRequest, CalibrateRequest, ScanRequest, VerifyRequest

BODIES: tuple[type[BaseModel], ...] = (CalibrateRequest, VerifyRequest, ScanRequest, ApplyRequest, Problem)
MODE: Literal["validation"] = "validation"
REF = "#/components/schemas/{model}"


def with_bodies(app: FastAPI) -> dict[str, Any]:
    """The document, complete: models of bodies that `access.body_of` reads, and of problems."""
    if app.openapi_schema is None:
        document = FastAPI.openapi(app)
        _, schemas = models_json_schema([(model, MODE) for model in BODIES], ref_template=REF)
        components = document.setdefault("components", {}).setdefault("schemas", {})
        for unused in ("HTTPValidationError", "ValidationError"):
            components.pop(unused, None)
        components.update(schemas["$defs"])
        app.openapi_schema = document
    return app.openapi_schema
