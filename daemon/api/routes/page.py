"""GET /page/: the operator's page, static files with a hash of them all in their path."""

from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException

from daemon.page import PageFile, PageFiles

router = APIRouter(prefix="/page", include_in_schema=False)

FOR_EVER = "public, max-age=31536000, immutable"


@router.get("")
async def page_without_slash() -> Response:
    """The page's address has a slash at its end."""
    return Response(status_code=308, headers={"Location": "/page/"})


@router.get("/")
async def index(
    request: Request, lang: str | None = None, theme: str | None = None, scale: str | None = None
) -> Response:
    """The document that names the files by their version; asked for anew each time. The page reads the parameters."""
    del lang, theme, scale
    return _respond(request, await _find(request, "index.html"), "no-cache")


@router.get("/{version}/{name:path}")
async def page_file(request: Request, version: str, name: str) -> Response:
    """A file of the present version; 404 for one of another version, whose page is to be loaded again."""
    files: PageFiles = request.app.state.page_files
    if version != await run_in_threadpool(lambda: files.version):
        raise HTTPException(404)
    return _respond(request, await _find(request, name), FOR_EVER)


async def _find(request: Request, name: str) -> PageFile:
    files: PageFiles = request.app.state.page_files
    found = await run_in_threadpool(files.find, name)
    if found is None:
        raise HTTPException(404)
    return found


def _respond(request: Request, file: PageFile, keep: str) -> Response:
    headers = {"Cache-Control": keep, "Vary": "Accept-Encoding"}
    packed = "gzip" in request.headers.get("accept-encoding", "")
    if packed:
        headers["Content-Encoding"] = "gzip"
    return Response(file.packed if packed else file.content, media_type=file.media_type, headers=headers)
