"""detections.json beside a run's session.json: what was found in each picture, and when it was taken."""

from pathlib import Path

from pydantic import Field, JsonValue

from calibration.documents.validation import Document, parse_document
from calibration.errors import DocumentError
from calibration.sentences.sentence import AS_WRITTEN, Sentence, as_sentence, is_known
from daemon.runtime.bounded_read import read_document

DETECTIONS_FILE = "detections.json"


class MissedDocument(Document):
    """Why the target was not found: a stable code, a sentence, and its id and parameters; files may lack the last."""

    code: str
    """Stable code of the reason."""
    what: str
    """The reason, a sentence."""
    id: str = AS_WRITTEN
    """Of the sentence, in the table of sentences."""
    params: dict[str, JsonValue] = Field(default_factory=dict)
    """Values of the sentence's places."""

    @classmethod
    def of(cls, code: str, what: str) -> "MissedDocument":
        return cls(code=code, what=str(what), **as_sentence(what).pair())

    def sentence(self) -> Sentence:
        """The sentence; of AS_WRITTEN where its id is not known here."""
        known = self.id != AS_WRITTEN and is_known(self.id)
        return Sentence(self.id, **self.params) if known else as_sentence(self.what)


class DetectionDocument(Document):
    """One picture."""

    index: int
    """Of the view, from 0."""
    at: str
    """When the picture was taken, UTC, ISO 8601."""
    configuration: tuple[int, ...]
    """The arm's posture as its controller gives it: cf1, cf4, cf6, cfx."""
    corners: tuple[tuple[int, float, float], ...] = ()
    """[id, u, v] of the points found, px; empty where there is none."""
    missing: MissedDocument | None = None
    """Why the target was not found; null where it was."""
    sharpness: float | None = None
    """Of the target in the picture, as in GET /camera/look; null where it was not measured."""


class DetectionsDocument(Document):
    """The whole of detections.json."""

    heading = "detectionsjson"

    schema_version: int = 1
    """Version of the format."""
    views: tuple[DetectionDocument, ...] = ()
    """One entry for each view."""

    def with_view(self, view: DetectionDocument) -> "DetectionsDocument":
        """The document with this view in place of an earlier one of its index."""
        others = [one for one in self.views if one.index != view.index]
        return DetectionsDocument(views=tuple(sorted([*others, view], key=lambda one: one.index)))


def read_detections(folder: Path) -> DetectionsDocument:
    """The detections of a session's folder; none in one that was written before they were kept."""
    try:
        return parse_document(DetectionsDocument, read_document(folder / DETECTIONS_FILE), DETECTIONS_FILE)
    except DocumentError:
        return DetectionsDocument()
