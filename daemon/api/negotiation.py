"""Content negotiation: JSON, or plain text when the request's Accept prefers it."""

from collections.abc import Callable
from typing import Any

from fastapi import Request, Response
from pydantic import BaseModel

from daemon.api.http_errors import NotAcceptable
from daemon.sessions.pictures import PictureType

TEXT = "text/plain"

PICTURE_TYPES: dict[str, PictureType] = {
    "image/jpeg": "image/jpeg",
    "image/webp": "image/webp",
    "image/png": "image/png",
}

MAX_MEDIA_RANGES = 30
"""A browser sends about ten."""

MAX_PARAMETERS_LENGTH = 200
"""Characters of a media range's parameters that are read."""


def wants_text(request: Request) -> bool:
    """True when Accept gives text/plain a higher weight than JSON (RFC 9110, 12.5.1)."""
    weights = {"application/json": 0.0, TEXT: 0.0}
    named: set[str] = set()
    wide = False
    for media, weight in media_ranges(request):
        wide = wide or media in ("application/*", "*/*")
        if media in weights:
            weights[media] = weight
            named.add(media)
    if wide and "application/json" not in named:
        weights["application/json"] = 0.001 if TEXT in named else 1.0
    return weights[TEXT] > weights["application/json"]


def choose_picture_type(request: Request) -> PictureType:
    """The format of a picture that Accept prefers; PNG where it names none. Raises NotAcceptable."""
    weights: dict[PictureType, float] = {}
    wide = 0.0
    for media, weight in media_ranges(request):
        if media in PICTURE_TYPES:
            weights[PICTURE_TYPES[media]] = weight
        elif media in ("*/*", "image/*"):
            wide = max(wide, weight)
    if "accept" not in request.headers:
        wide = 1.0
    weights.setdefault("image/png", wide)
    best = max(weights, key=lambda media: weights[media])
    if weights[best] <= 0:
        raise NotAcceptable("pictures are image/png, image/jpeg or image/webp", "set Accept to one of these")
    return best


def media_ranges(request: Request) -> list[tuple[str, float]]:
    """The first MAX_MEDIA_RANGES media ranges of Accept in lower case, each with its weight."""
    return weighted_values(request, "accept")


def weighted_values(request: Request, header: str) -> list[tuple[str, float]]:
    """The first MAX_MEDIA_RANGES values of such a header in lower case, each with its weight."""
    parts = ",".join(request.headers.getlist(header)).split(",", MAX_MEDIA_RANGES)[:MAX_MEDIA_RANGES]
    split = [part.strip().lower().partition(";") for part in parts]
    return [(value.strip(), _weight_of(parameters)) for value, _, parameters in split if value.strip()]


def _weight_of(parameters: str) -> float:
    """The q of a media range's parameters; 1 by default."""
    for parameter in parameters[:MAX_PARAMETERS_LENGTH].split(";"):
        name, _, value = parameter.strip().partition("=")
        if name == "q":
            try:
                return float(value)
            except ValueError:
                return 0.0
    return 1.0


def respond(
    request: Request,
    document: BaseModel,
    words: Callable[[], str],
    status: int = 200,
    headers: dict[str, str] | None = None,
) -> Response:
    """Answer `document` as JSON, or `words()` as text."""
    every = {**(headers or {}), "Vary": "Accept"}
    if wants_text(request):
        return Response(words().rstrip("\n") + "\n", status, every, media_type=TEXT)
    return Response(document.model_dump_json(), status, every, media_type="application/json")


def respond_created(document: BaseModel, location: str) -> Response:
    """Answer what was made and stored, and where it is."""
    return Response(document.model_dump_json(), 201, {"Location": location}, media_type="application/json")


def or_text(description: str) -> dict[str, Any]:
    """The `responses` entry for an answer that is also available as text."""
    return {"description": description, "content": {TEXT: {"schema": {"type": "string"}}}}
