"""GET /page/: the operator's page, static files with a hash of them all in their path. GET /docs/: the documentation.

The documentation is as `make docs` builds it, where the installation has it; nothing of it is fetched.
"""

from pathlib import Path

from fastapi import Request, Response
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.staticfiles import StaticFiles

from daemon.api.dependencies import api_router
from daemon.errors import NotFound
from daemon.page import PageFile, PageFiles

router = api_router(prefix="/page", include_in_schema=False)

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


SITE = Path(__file__).parents[2] / "site"
"""Built before the wheel and the Debian package are; a checkout has it after `make docs`."""

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src {docs};"
    " font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Scripts of this daemon only, which read the site and nothing else: the theme's are not ours, and write HTML."""

docs = api_router(prefix="/docs", include_in_schema=False)


@docs.get("")
async def docs_without_slash() -> Response:
    """The documentation's address has a slash at its end."""
    return Response(status_code=308, headers={"Location": "/docs/"})


@docs.get("/{name:path}")
async def document(request: Request, name: str, h: str | None = None) -> Response:
    """A file of the site, or a folder's index.html; `h` is what a search has found, and is read by the page."""
    del h
    if not SITE.is_dir():
        raise NotFound("this installation has no documentation", "make docs builds it; a release brings it")
    response = await StaticFiles(directory=SITE, html=True, check_dir=False).get_response(name or ".", request.scope)
    response.headers["Content-Security-Policy"] = CONTENT_SECURITY_POLICY.format(docs=f"{request.base_url}docs/")
    response.headers["Cache-Control"] = "no-cache"
    return response
