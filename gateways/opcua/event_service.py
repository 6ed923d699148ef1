"""Events as OPC 10000-9, 4.5 and 5.5.7, has them delivered, where asyncua 2.1 delivers less.

asyncua sends an event to who listens at its own node alone, filters what frames a refresh, and keeps a condition as an
object that the next event of its kind changes. Alarm clients listen at the Server object, and come late.
"""

from copy import copy
from typing import Any

from asyncua import ua, uamethod
from asyncua.server.internal_subscription import InternalSubscription
from asyncua.server.subscription_service import SubscriptionService

SERVER = ua.NodeId(ua.ObjectIds.Server)


class EventService(SubscriptionService):  # type: ignore[misc] # asyncua's names are made while it runs
    """Subscriptions whose events reach the Server object as well, and whose refresh has every condition."""

    async def trigger_event(self, event: Any, subscription_id: int | None = None) -> None:
        """Send to who listens at the event's node or at the Server object.

        asyncua names a subscription for what frames its refresh: that reaches all of it, whatever its filters ask for.
        """
        if subscription_id is not None:
            service = self.subscriptions[subscription_id].monitored_item_srv
            for number in [number for numbers in service._monitored_events.values() for number in numbers]:
                asked = service._monitored_items[number]
                fields = ua.EventFieldList(asked.client_handle, event.to_event_fields(asked.filter.SelectClauses))
                await service.isub.enqueue_event(number, fields, asked.queue_size)
            return
        if hasattr(event, "Retain"):
            self._conditions.pop(event.NodeId, None)
            if event.Retain:
                self._conditions[event.NodeId] = copy(event)
        for subscription in list(self.subscriptions.values()):
            await _send(subscription, event)

    @uamethod  # type: ignore[untyped-decorator]
    async def condition_refresh(self, parent: Any, subscription_id: int, item: int | None = None) -> Any:
        """Send to a subscription, or one item of it, every condition that is there."""
        subscription = self.subscriptions.get(subscription_id)
        if subscription is None:
            return ua.StatusCode(ua.StatusCodes.BadSubscriptionIdInvalid)
        if item is not None and item not in subscription.monitored_item_srv._monitored_items:
            return ua.StatusCode(ua.StatusCodes.BadMonitoredItemIdInvalid)
        await self.standard_events[ua.ObjectIds.RefreshStartEventType].trigger(subscription_id=subscription_id)
        for event in list(self._conditions.values()):
            await _send(subscription, event, item)
        await self.standard_events[ua.ObjectIds.RefreshEndEventType].trigger(subscription_id=subscription_id)
        return None


async def _send(subscription: InternalSubscription, event: Any, item: int | None = None) -> None:
    service = subscription.monitored_item_srv
    for node in {event.emitting_node, SERVER}:
        for number in list(service._monitored_events.get(node, ())):
            if item in (None, number):
                await service._trigger_event(event, number)
