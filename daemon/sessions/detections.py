"""detections.json beside a run's session.json: what was found in each picture, and when it was taken."""

from pathlib import Path

from pydantic import Field, JsonValue

from calibration.documents.validation import Document, parse_document
from calibration.errors import DocumentError
from calibration.sentences.english import ENGLISH
from calibration.sentences.sentence import AS_WRITTEN, Sentence, as_sentence
from daemon.runtime.bounded_read import read_document

DETECTIONS_FILE = "detections.json"


class MissedDocument(Document):
    """Why the target was not found: a stable code, a sentence, and its id and parameters; files may lack the last."""

    code: str
    what: str
    id: str = AS_WRITTEN
    params: dict[str, JsonValue] = Field(default_factory=dict)

    @classmethod
    def of(cls, code: str, what: str) -> "MissedDocument":
        return cls(code=code, what=str(what), **as_sentence(what).pair())

    def sentence(self) -> Sentence:
        """The sentence; of AS_WRITTEN where its id is not known here."""
        known = self.id != AS_WRITTEN and self.id in ENGLISH
        return Sentence(self.id, **self.params) if known else as_sentence(self.what)


class DetectionDocument(Document):
    """One picture. `corners`: [id, u, v] in px; `configuration`: the arm's posture, as its controller gives it.

    `sharpness`: as of GET /camera/look; null where it was not measured.
    """

    index: int
    at: str
    configuration: tuple[int, ...]
    corners: tuple[tuple[int, float, float], ...] = ()
    missing: MissedDocument | None = None
    sharpness: float | None = None


class DetectionsDocument(Document):
    """The whole of detections.json."""

    heading = "detectionsjson"

    schema_version: int = 1
    views: tuple[DetectionDocument, ...] = ()

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
