"""The page's files: served with a hash in their path, packed, and the libraries among them as they were built."""

import gzip
import hashlib
import json
import re

import httpx
import pytest

from calibration.sentences.sentence import LANGUAGES, sections_in
from daemon.page import FOLDER, PageFiles
from daemon.scans.upload import SUFFIXES
from tests.daemon.cell_under_test import Bench


async def test_a_browser_is_sent_to_the_page(bench: Bench) -> None:
    sent = await bench.client.get("/", headers={"Accept": "text/html,*/*"})
    assert (sent.status_code, sent.headers["Location"]) == (303, "/page/")
    assert (await bench.client.get("/")).json()["software"]


def test_the_page_offers_the_clouds_that_the_daemon_takes() -> None:
    (named,) = re.findall(r"const TYPES = \{(.*)\}", (FOLDER / "screens" / "scans.js").read_text())
    offered = dict(re.findall(r"(\w+): '([^']+)'", named))
    assert {f".{suffix}": media_type for suffix, media_type in offered.items()} == {
        suffix: media_type for media_type, suffix in SUFFIXES.items() if suffix != ".f32"
    }


async def test_the_index_is_asked_anew_and_the_files_are_kept(bench: Bench) -> None:
    index = await bench.client.get("/page/")
    assert index.headers["Cache-Control"] == "no-cache"
    assert "unsafe" not in index.headers["Content-Security-Policy"]
    named = re.findall(r'(?:href|src)="([^"]+)"', index.text)
    assert len(named) >= 4
    for name in named:
        file = await bench.client.get(f"/page/{name}")
        assert file.status_code == 200, name
        assert "immutable" in file.headers["Cache-Control"]


@pytest.mark.parametrize(
    "path", ["/page/0000000000000000/app.js", "/page/{version}/nothing.js", "/page/{version}/../__init__.py"]
)
async def test_no_other_file_is_served(bench: Bench, path: str) -> None:
    url = str(bench.client.base_url) + path.format(version=PageFiles().version)
    answer = await bench.client.send(httpx.Request("GET", httpx.URL(url)))
    assert answer.status_code == 404


async def test_files_are_packed_for_those_who_unpack(bench: Bench) -> None:
    path = f"/page/{PageFiles().version}/app.js"
    packed = await bench.client.get(path, headers={"Accept-Encoding": "gzip"})
    plain = await bench.client.get(path, headers={"Accept-Encoding": "identity"})
    assert packed.headers["Content-Encoding"] == "gzip"
    assert "Content-Encoding" not in plain.headers
    assert packed.content == plain.content == (FOLDER / "app.js").read_bytes()


def test_the_shell_is_small() -> None:
    """At most 60 kB packed: what is fetched before the first screen, without the screens."""
    shell = ("index.html", "page.css", "words/en.json", *PageFiles().shell)
    assert "vendor/preact.js" in shell
    assert "vendor/three.js" not in shell
    assert sum(len(gzip.compress((FOLDER / name).read_bytes())) for name in shell) <= 60_000


async def test_the_shell_is_fetched_at_once(bench: Bench) -> None:
    """The index names every module of the shell, and its words: none waits until another has come and asks for it."""
    index = (await bench.client.get("/page/")).text
    named = re.findall(r'<(?:link rel="modulepreload" href|script type="module" src)="[0-9a-f]{16}/([^"]+)"', index)
    assert sorted(named) == sorted(PageFiles().shell)
    assert f'<link rel="preload" as="fetch" crossorigin href="{PageFiles().version}/words/en.json">' in index


async def test_the_page_reads_the_sentences_of_the_reports(bench: Bench) -> None:
    for tag in LANGUAGES:
        served = await bench.client.get(f"/page/{PageFiles().version}/words/sentences.{tag}.json")
        assert served.headers["Content-Type"] == "application/json"
        assert served.json() == sections_in(tag)


def test_libraries_are_as_they_were_built() -> None:
    vendored = json.loads((FOLDER / "vendor" / "vendored.json").read_text())
    for name, expected in vendored["sha256"].items():
        assert hashlib.sha256((FOLDER / "vendor" / name).read_bytes()).hexdigest() == expected, name
    licences = (FOLDER / "vendor" / "LICENSES.txt").read_text()
    assert all(f"{package['name']} {package['version']}" in licences for package in vendored["packages"])
