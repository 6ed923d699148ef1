"""GET /help: what each code means."""

from collections.abc import Iterator

from calibration.errors import CalibrationError
from calibration.sentences.sentence import sections_in
from daemon.api.dependencies import App, Identifier, api_router
from daemon.api.problems import HTTP_CODES, problem_responses, status_of_kind
from daemon.api.schemas.about import HelpDocument, HelpList
from daemon.errors import DaemonError, NotFound
from drivers.errors import DeviceError
from registration.errors import RegistrationError

router = api_router(prefix="/help", tags=["health"])

FINDINGS = ("views", "view-causes", "session-causes", "findings")
"""Sections of the sentences whose ids are codes of findings."""


@router.get("", response_model=HelpList)
async def every_code(app: App) -> HelpList:
    """Every code of errors, findings and advice."""
    return HelpList(help=sorted(_entries().values(), key=lambda entry: entry.code))


@router.get("/{code}", response_model=HelpDocument, responses=problem_responses(404))
async def one_code(app: App, code: Identifier) -> HelpDocument:
    """What one code means."""
    entry = _entries().get(code)
    if entry is None:
        raise NotFound(f"there is no code {code!r}", "GET /help lists them")
    return entry


def _entries() -> dict[str, HelpDocument]:
    """By code: of errors what their class says, of sentences their template."""
    sections = sections_in("en")
    found = {
        code: HelpDocument(code=code, kind="finding", what=text)
        for section in FINDINGS
        for code, text in sections[section].items()
    }
    found |= {code: HelpDocument(code=code, kind="advice", what=text) for code, text in sections["advice"].items()}
    for kind in (DaemonError, DeviceError, RegistrationError, CalibrationError):
        for error in _leaves(kind):
            code = getattr(error, "code", None)
            if isinstance(code, str):
                what = (error.__doc__ or "").strip().partition("\n")[0]
                found[code] = HelpDocument(code=code, kind="error", what=what, status=status_of_kind(error))
    for status, (code, fix) in HTTP_CODES.items():
        found[code] = HelpDocument(code=code, kind="error", what=fix, status=status)
    return found


def _leaves(kind: type[Exception]) -> Iterator[type[Exception]]:
    """The class and its subclasses, bases first."""
    yield kind
    for inner in kind.__subclasses__():
        yield from _leaves(inner)
