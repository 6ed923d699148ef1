"""Recognises a Modbus TCP request that comes again after newer ones, by its transaction number."""

from collections import OrderedDict

from protocols.modbus.mbap import Adu

KEPT = 64
"""Requests that are remembered. A client that counts to less before it begins again does not number its requests."""


class RequestNumbers:
    """The latest requests of one connection.

    The Modbus TCP implementation guide asks for a new number for each request. Of a client that gives one number to two
    different requests nothing is recognised.
    """

    def __init__(self) -> None:
        self._latest: OrderedDict[int, bytes] = OrderedDict()
        self._numbered = True

    def is_repeated(self, adu: Adu) -> bool:
        """Note a request; True when the same one, with the same number, came before others that came since."""
        before = self._latest.get(adu.transaction)
        if before is not None and before != adu.pdu:
            self._numbered = False
        newest = next(reversed(self._latest), None) == adu.transaction
        if before is None:
            self._latest[adu.transaction] = adu.pdu
            if len(self._latest) > KEPT:
                self._latest.popitem(last=False)
        return self._numbered and before is not None and not newest
