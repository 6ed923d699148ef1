"""GET /docs/: the documentation as `make docs` builds it, where the installation has it; nothing of it is fetched."""

from pathlib import Path

from fastapi import APIRouter, Request, Response
from starlette.staticfiles import StaticFiles

from daemon.errors import NotFound

SITE = Path(__file__).parents[2] / "site"
"""Built before the wheel and the Debian package are; a checkout has it after `make docs`."""

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src {docs};"
    " font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Scripts of this daemon only, which read the site and nothing else: the theme's are not ours, and write HTML."""

router = APIRouter(prefix="/docs", include_in_schema=False)


@router.get("")
async def docs_without_slash() -> Response:
    """The documentation's address has a slash at its end."""
    return Response(status_code=308, headers={"Location": "/docs/"})


@router.get("/{name:path}")
async def document(request: Request, name: str, h: str | None = None) -> Response:
    """A file of the site, or a folder's index.html; `h` is what a search has found, and is read by the page."""
    del h
    if not SITE.is_dir():
        raise NotFound("this installation has no documentation", "make docs builds it; a release brings it")
    response = await StaticFiles(directory=SITE, html=True, check_dir=False).get_response(name or ".", request.scope)
    response.headers["Content-Security-Policy"] = CONTENT_SECURITY_POLICY.format(docs=f"{request.base_url}docs/")
    response.headers["Cache-Control"] = "no-cache"
    return response
