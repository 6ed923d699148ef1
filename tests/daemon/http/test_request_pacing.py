"""Few requests begin in a turn of the event loop, and an abort goes before those that wait."""

import asyncio

import pytest

from daemon.http.request_pacing import MAX_BEGUN_A_TURN, RequestPacing
from tests.support.waiting import eventually


async def turns(count: int) -> None:
    for _ in range(count):
        await asyncio.sleep(0)


def arrive(pacing: RequestPacing, begun: list[str], name: str, *, urgent: bool = False) -> None:
    if pacing.take():
        begun.append(name)
    else:
        pacing.wait(lambda: begun.append(name), urgent=urgent)


async def test_the_first_ones_begin_at_once_and_the_others_a_few_a_turn_in_their_order() -> None:
    pacing, begun = RequestPacing(), list[str]()
    names = [str(number) for number in range(20)]
    for name in names:
        arrive(pacing, begun, name)
    while len(begun) < len(names):
        before = len(begun)
        await turns(1)
        assert len(begun) <= before + MAX_BEGUN_A_TURN
    assert begun == names


async def test_an_urgent_one_goes_before_a_thousand_that_came_earlier() -> None:
    pacing, begun = RequestPacing(), list[str]()
    for number in range(1000):
        arrive(pacing, begun, str(number))
    arrive(pacing, begun, "abort", urgent=True)
    await turns(2)
    assert "abort" in begun
    assert begun.index("abort") <= MAX_BEGUN_A_TURN


async def test_while_held_only_urgent_ones_begin_and_afterwards_all() -> None:
    pacing, begun = RequestPacing(), list[str]()
    for number in range(10):
        arrive(pacing, begun, str(number))
    at_once = begun.copy()
    pacing.hold()
    assert pacing.held
    arrive(pacing, begun, "late")
    arrive(pacing, begun, "abort", urgent=True)
    await turns(50)
    assert begun == [*at_once, "abort"]
    pacing.release()
    await turns(50)
    assert begun == [*at_once, "abort", *map(str, range(len(at_once), 10)), "late"]


async def test_a_hold_that_nobody_releases_ends_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daemon.http.request_pacing.MAX_HOLD_S", 0.01)
    pacing, begun = RequestPacing(), list[str]()
    pacing.hold()
    arrive(pacing, begun, "other")
    assert begun == []
    await eventually(lambda: begun == ["other"])
    assert not pacing.held


async def test_after_a_rest_the_first_ones_begin_at_once_again() -> None:
    pacing, begun = RequestPacing(), list[str]()
    for _ in range(3):
        for number in range(MAX_BEGUN_A_TURN):
            arrive(pacing, begun, str(number))
        assert len(begun) % MAX_BEGUN_A_TURN == 0
        await turns(3)
    assert len(begun) == 3 * MAX_BEGUN_A_TURN


async def test_one_that_begins_may_wait_again() -> None:
    pacing, begun = RequestPacing(), list[int]()

    def begin() -> None:
        begun.append(len(begun))
        if len(begun) < 50:
            pacing.wait(begin, urgent=False)

    pacing.wait(begin, urgent=False)
    await turns(200)
    assert len(begun) == 50


async def test_an_error_of_one_holds_no_other_up() -> None:
    pacing, begun = RequestPacing(), list[str]()
    errors: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: errors.append(context["exception"]))

    def fail() -> None:
        raise ValueError

    pacing.wait(fail, urgent=False)
    for number in range(10):
        arrive(pacing, begun, str(number))
    await turns(20)
    assert begun == [str(number) for number in range(10)]
    assert len(errors) == 1
