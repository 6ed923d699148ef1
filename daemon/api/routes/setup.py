"""GET, PUT /setup and POST /setup/try: the first set-up of a cell, as `handeyed init` asks it. Nothing moves."""

import asyncio
import base64
import hashlib
from pathlib import Path
from typing import Annotated

from fastapi import Depends, Header, Query, Response
from pydantic import Field

from calibration.documents.target_text import target_of_text
from calibration.documents.validation import Document
from daemon.api.dependencies import App, JsonBody, api_router, in_content
from daemon.api.problems import problem_responses
from daemon.application import Application
from daemon.errors import AnswerRefused, SetupConflict, StorageError
from daemon.sessions.pictures import encode_picture
from daemon.store.actor import current_audit_context
from daemon.tools.camera_discovery import Discovery, discover
from daemon.tools.first_setup.devices import find_controllers
from daemon.tools.first_setup.interview import QUESTIONS, USUAL, AnswerFound, Interview
from daemon.tools.first_setup.settings_before import SettingsBefore, write_settings
from daemon.tools.target_print.layout import lay_out
from daemon.tools.target_print.pdf import pdf

router = api_router(prefix="/setup", tags=["cell"])

NEEDED = {
    "model": ("controller",),
    "target": ("camera",),
    "size": ("camera", "setup", "target"),
    "box": ("controller", "model"),
}
"""By answer, those of which its check goes out."""
MAX_SETTINGS = 200_000

Question = Annotated[str, Field(pattern=f"^({'|'.join(QUESTIONS)})$")]


class SetupSettings(Document):
    """A settings file."""

    settings: Annotated[str, Field(max_length=MAX_SETTINGS)] | None = None
    """Its text, from which answers are proposed, and of which stays what is not asked; null: the file that is there."""


class SetupAnswers(SetupSettings):
    """The answers of `handeyed init`."""

    answers: dict[Question, Annotated[str, Field(max_length=500)]]
    """By question, as a terminal takes them; what is left out is as usual."""


class SetupTry(SetupAnswers):
    """An answer to check."""

    question: Question
    """Which of the answers is checked; the others are those before it."""


class SetupTried(AnswerFound):
    """What came of an answer."""

    picture: str | None = None
    """The camera's picture: JPEG, in base64."""


class SetupBefore(Document):
    """What a settings file answers."""

    answers: dict[str, str]
    """By question, to propose; addresses without passwords, which stay as they are."""
    found: tuple[str, ...]
    """What stays of it, or why nothing is taken from it: lines for a person."""


class SetupDocument(Document):
    """What is set up, and what was found."""

    set_up: bool
    """Whether this daemon runs with a cell that is set up; it is set up anew by `handeyed serve --setup`."""
    file: str | None
    """The settings file; null for a daemon without one."""
    sha256: str | None
    """Of what it holds now, hexadecimal, the ETag of PUT; null while there is none."""
    controllers: tuple[str, ...]
    """Controllers that answer at the usual address."""
    cameras: tuple[Discovery, ...]
    """Cameras that answer discovery, and what kept an interface from looking."""
    before: SetupBefore | None
    """What the settings file that is there answers; null for a cell that is set up."""


class SetupWritten(Document):
    """The settings are written; the daemon begins anew with them."""

    file: str
    """Where."""
    kept: str | None
    """Where the file that was there is kept; null when there was none."""


@router.get("", response_model=SetupDocument, responses=problem_responses(403))
async def read_setup(app: App, response: Response) -> SetupDocument:
    """What is set up. While nothing is, controllers and cameras are looked for, for a second or two."""
    file = app.setup_file or (None if app.settings_file is None else Path(app.settings_file.file))
    sha256 = None if file is None else await asyncio.to_thread(_hash_of, file)
    response.headers["ETag"] = f'"{sha256}"'
    looks = app.setup_file is not None
    return SetupDocument(
        set_up=not looks,
        file=None if file is None else str(file),
        sha256=sha256,
        controllers=tuple(await find_controllers()) if looks else (),
        cameras=tuple(await asyncio.to_thread(discover)) if looks else (),
        before=await asyncio.to_thread(_read, app, None) if looks else None,
    )


@router.post("/read", response_model=SetupBefore, responses=problem_responses(400, 403, 409, 422))
async def read_answers(app: App, body: Annotated[SetupSettings, Depends(JsonBody(SetupSettings))]) -> SetupBefore:
    """The answers of a settings file. Nothing is tried or written."""
    return await asyncio.to_thread(_read, app, body.settings)


@router.get("/target.pdf", **in_content("One page", {"application/pdf": {}}, 403, 422))
async def print_target(
    target: Annotated[str, Query(max_length=200, description="as charuco:12x9:20:15:DICT_5X5_100, in mm")],
    page: Annotated[
        str | None,
        Query(max_length=20, description="as for `handeyed target`; without it the smallest of A4 to A0 that holds it"),
    ] = None,
) -> Response:
    """The target to print, true to size, as `handeyed target` writes it."""
    sheet = await asyncio.to_thread(lay_out, target_of_text(target), page)
    return Response(
        pdf(sheet), media_type="application/pdf", headers={"Content-Disposition": 'inline; filename="target.pdf"'}
    )


@router.post("/try", response_model=SetupTried, responses=problem_responses(400, 403, 409, 422, 502, 503, 504))
async def try_answer(app: App, body: Annotated[SetupTry, Depends(JsonBody(SetupTry))]) -> SetupTried:
    """Check one answer at the devices: what they say, a picture, the target in it. Nothing moves or is written."""
    interview, given = await asyncio.to_thread(_interview, app, body.settings), {**USUAL, **body.answers}
    for name in NEEDED.get(body.question, ()):
        if name == "camera":
            await interview.take_camera(given.get(name, ""), look=False)
        elif name != "model" or interview.model is None:
            await interview.take(name, given.get(name, ""))
    found = await interview.take(body.question, given.get(body.question, ""))
    picture = None
    if body.question in ("camera", "target") and interview.camera is not None:
        content = await app.service_workers.run(encode_picture, interview.camera.image, "image/jpeg", 960)
        picture = base64.b64encode(content).decode()
    return SetupTried(**dict(found), picture=picture)


@router.put("", response_model=SetupWritten, responses=problem_responses(400, 403, 409, 422, 502, 503, 504, 507))
async def write_setup(
    app: App,
    body: Annotated[SetupAnswers, Depends(JsonBody(SetupAnswers))],
    if_match: Annotated[str, Header(max_length=80, description="ETag of GET /setup")],
) -> SetupWritten:
    """Check every answer once more, write the settings file, and begin anew with it. The file that is there is kept."""
    file = _file_to_write(app)
    interview, given = await asyncio.to_thread(_interview, app, body.settings), {**USUAL, **body.answers}
    for name in QUESTIONS:
        if name != "model" or interview.model is None:
            found = await interview.take(name, given.get(name, ""))
            if not found.complete and name != "target":
                raise AnswerRefused(f"the answer to {name} is not complete", "try it first, and send what it becomes")
    text = interview.settings_text()
    if if_match != f'"{await asyncio.to_thread(_hash_of, file)}"':
        raise SetupConflict(f"{file} is another file than was read", "ask GET /setup again, and look at what is there")
    try:
        kept = await asyncio.to_thread(write_settings, file, text)
    except OSError as error:
        what = f"{file} cannot be written ({error.strerror})"
        raise StorageError(what, "let the daemon's user write there") from None
    sha256, by = hashlib.sha256(text.encode()).hexdigest(), current_audit_context()
    await app.store.audit.append(by, app.clock.timestamp(), "write settings", str(file), sha256=sha256)
    app.begins_anew = True
    app.begin_stop("the first set-up, which is done")
    app.end()
    return SetupWritten(file=str(file), kept=None if kept is None else str(kept))


def _file_to_write(app: Application) -> Path:
    """Raises SetupConflict: devices that a daemon holds are not asked beside it."""
    if app.setup_file is None:
        raise SetupConflict("this daemon runs with a cell that is set up", "stop it, then handeyed serve --setup FILE")
    return app.setup_file


def _interview(app: Application, text: str | None) -> Interview:
    """One that begins with the file that is there, or a `text` in its place. Raises DocumentError, SetupConflict."""
    before = SettingsBefore.of_file(_file_to_write(app), app.settings.server.port)
    return Interview(before=before if text is None else before.with_answers_of(text.encode(), "settings"))


def _read(app: Application, text: str | None) -> SetupBefore:
    before = _interview(app, text).before
    return SetupBefore(answers=before.answers(), found=before.lines())


def _hash_of(file: Path) -> str | None:
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.exists() else None
