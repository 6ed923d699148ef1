"""Server-sent events as a client reads them."""

import asyncio

import httpx

from tests.support.waiting import LIMIT_S


async def read_events(client: httpx.AsyncClient, until: str, last_event_id: str) -> list[dict[str, str]]:
    events: list[dict[str, str]] = [{}]
    async with (
        asyncio.timeout(LIMIT_S),
        client.stream("GET", "/events", headers={"last-event-id": last_event_id}) as answer,
    ):
        async for line in answer.aiter_lines():
            key, _, value = line.partition(": ")
            if key:
                events[-1][key] = value
            elif f'"state": "{until}"' in events[-1].get("data", ""):
                return events
            elif "data" in events[-1]:
                events.append({})
            else:
                events[-1] = {}
    raise AssertionError("the stream ended")
