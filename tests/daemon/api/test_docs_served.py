"""GET /docs/: the built site, without a key, with scripts of this daemon only; in words where it was not built."""

from pathlib import Path

import httpx
import pytest

from daemon.api.routes import page
from tests.daemon.cell_under_test import Bench


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "site"
    (folder / "api").mkdir(parents=True)
    (folder / "index.html").write_text("<h1>handeyed</h1>")
    (folder / "api" / "index.html").write_text("<h1>REST</h1>")
    (folder / "script.js").write_text("1")
    (tmp_path / "secret").write_text("not for you")
    monkeypatch.setattr(page, "SITE", folder)
    return folder


async def test_the_site_is_served_without_a_key(bench: Bench, site: Path) -> None:
    assert (await bench.client.get("/docs")).headers["Location"] == "/docs/"
    made = await bench.client.post("/keys", json={"name": "Ann", "role": "admin"})
    assert made.status_code == 201
    assert (await bench.client.get("/runs")).status_code == 401
    for path, text in (("/docs/", "handeyed"), ("/docs/api/", "REST"), ("/docs/api/?h=run", "REST")):
        page = await bench.client.get(path)
        assert (page.status_code, text in page.text) == (200, True), path
        policy = page.headers["Content-Security-Policy"]
        assert "script-src 'self';" in policy
        assert f"connect-src {bench.url}/docs/;" in policy, "its scripts ask for the site only"
        assert policy.count("http") == 1
    assert (await bench.client.get("/docs/script.js")).headers["Content-Type"].startswith("text/javascript")
    followed = await bench.client.get("/docs/api", follow_redirects=True)
    assert "REST" in followed.text


@pytest.mark.parametrize("path", ["/docs/../secret", "/docs/%2e%2e/secret", "/docs//etc/passwd", "/docs/nothing"])
async def test_nothing_outside_the_site_is_served(bench: Bench, site: Path, path: str) -> None:
    answer = await bench.client.send(httpx.Request("GET", httpx.URL(str(bench.client.base_url).rstrip("/") + path)))
    assert answer.status_code == 404


async def test_links_name_the_site_where_it_is(bench: Bench, site: Path) -> None:
    assert (await bench.client.get("/")).json()["links"]["docs"] == "/docs/"


async def test_a_daemon_without_the_site_says_how_to_get_it(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page, "SITE", tmp_path / "nowhere")
    answer = await bench.client.get("/docs/")
    assert (answer.status_code, answer.json()["code"]) == (404, "not-found")
    assert "make docs" in answer.json()["fix"]
    assert "docs" not in (await bench.client.get("/")).json()["links"]
