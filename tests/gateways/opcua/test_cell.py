"""One cell as its daemon's answers have it."""

from collections.abc import AsyncIterator, Mapping
from typing import Any

import pytest

from gateways.opcua.cell import Away, Cell, Refusal
from gateways.opcua.cell_state import CellState
from gateways.opcua.settings import CellSettings


@pytest.mark.parametrize(("status", "heard", "last"), [(404, ["r2"], "2"), (503, [], "0")])
async def test_an_ended_run_that_is_no_longer_stored_holds_up_no_later_one(
    monkeypatch: pytest.MonkeyPatch, status: int, heard: list[str], last: str
) -> None:
    results: list[str] = []

    async def change(_: object) -> None:
        pass

    async def take(run: Mapping[str, Any]) -> None:
        results.append(run["id"])

    async def get(path: str, key: str | None = None, **_: Any) -> Any:
        if path == "/runs/r1":
            raise Refusal(status, "code", "what", "fix")
        return {"id": path.rpartition("/")[2]}

    async def listen(*_: Any) -> AsyncIterator[tuple[str, dict[str, Any]]]:
        for number in ("1", "2"):
            yield number, {"event": "run", "state": "finished", "id": f"r{number}"}
        raise Away

    cell = Cell(CellSettings(name="cell7", url="http://127.0.0.1:1"), change, take)
    cell._last_event = "0"
    monkeypatch.setattr(cell, "get", get)
    monkeypatch.setattr(cell, "_listen", listen)
    with pytest.raises(Away if status == 404 else Refusal):
        await cell._follow_events()
    assert (results, cell._last_event) == (heard, last)


@pytest.mark.parametrize(
    ("live", "stored", "aborted"),
    [
        ("r1", [{"id": "r2", "over": False}], "/runs/r2/abort"),
        ("r1", [{"id": "r1", "over": True}], None),
        (None, [{"id": "r2", "over": False}], "/runs/r2/abort"),
        ("r1", Refusal(503, "store-unsound", "what", "fix"), "/runs/r1/abort"),
        ("r1", Away("no answer in time"), "/runs/r1/abort"),
        (None, Refusal(503, "store-unsound", "what", "fix"), Refusal),
    ],
)
async def test_an_abort_stops_the_run_that_is_stored_and_else_the_one_that_was_heard_of(
    monkeypatch: pytest.MonkeyPatch, live: str | None, stored: Any, aborted: Any
) -> None:
    async def change(_: object) -> None:
        pass

    async def get(*_: Any, **__: Any) -> Any:
        if isinstance(stored, Exception):
            raise stored
        return {"runs": stored}

    posted: list[str | None] = []

    async def post(path: str, *_: Any) -> None:
        posted.append(path)

    cell = Cell(CellSettings(name="cell7", url="http://127.0.0.1:1"), change, change)
    cell.state = CellState(reached=True, live={"run": live and {"id": live}})
    monkeypatch.setattr(cell, "get", get)
    monkeypatch.setattr(cell, "post", post)
    if aborted is Refusal:
        with pytest.raises(Refusal):
            await cell.abort("key")
    else:
        await cell.abort("key")
    assert (posted or [None])[0] == (None if aborted is Refusal else aborted)
