"""Names of actors in the audit log: the daemon's own, and which names keys may have beside them."""

import re
import unicodedata

from daemon.runtime.logs import redact_keys
from drivers.transports.late_address import is_address

DAEMON = "handeyed"
DRIFT_SCHEDULE = "the drift schedule"
AUTO_POLICY = "policy auto"
LOCAL_CLIENT = "local"
SERVICE_GROUP = "the service's group"
PLC_CLIENT = "the PLC at"
"""Start of a PLC's name; its address follows."""

RESERVED = (DAEMON, DRIFT_SCHEDULE, AUTO_POLICY, LOCAL_CLIENT, SERVICE_GROUP)
"""No key's name may look like one of these, or begin as a PLC's."""

MAX_LENGTH = 100

UNDECOMPOSED = str.maketrans({"ø": "o", "ł": "l", "đ": "d", "ð": "d", "ħ": "h", "æ": "ae", "œ": "oe", "þ": "th"})
"""Letters of Latin alphabets that Unicode does not decompose into one of ASCII and a mark."""

LOOK_ALIKE = str.maketrans({"0": "o", "1": "l", "i": "l", "|": "l"})


def skeleton(name: str) -> str:
    """The letters and digits of `name` by their looks, for comparison: "Pölicy_AUT0" gives "pollcyauto".

    Empty when one of its characters has no counterpart in ASCII: a Cyrillic а looks like a Latin a.
    """
    folded = unicodedata.normalize("NFKD", unicodedata.normalize("NFKC", name).casefold().translate(UNDECOMPOSED))
    plain = "".join(c for c in folded if not unicodedata.combining(c))
    if not plain.isascii() or not plain.isprintable():
        return ""
    letters = "".join(c for c in plain.translate(LOOK_ALIKE) if c.isalnum())
    return letters.replace("rn", "m").replace("vv", "w")


def imitates_actor(name: str) -> bool:
    """Whether `name` looks like the name of an actor that has no key: the daemon's own, or a PLC's."""
    looks = skeleton(name)
    return looks in {skeleton(actor) for actor in RESERVED} or looks.startswith(skeleton(PLC_CLIENT))


def validate_key_name(name: str) -> str:
    """`name`, if a key may have it. Raises ValueError with the reason and what to do."""
    if not (0 < len(name) <= MAX_LENGTH and name.isprintable() and name == " ".join(name.split())):
        raise ValueError(f"a name is 1 to {MAX_LENGTH} printable characters with single spaces; choose another")
    if unicodedata.normalize("NFKC", name) != name or not skeleton(name):
        raise ValueError("a name is of Latin letters and digits, which no others imitate; choose another")
    # The audit log shows a client's address so, with or without a port.
    like_one = re.fullmatch(r"[0-9a-fx.:%\[\]]*[.:][0-9a-fx.:%\[\]]*", name.casefold())
    is_one = any(map(is_address, (name, name.rpartition(":")[0], name.strip("[]"))))
    if imitates_actor(name) or like_one or is_one:
        raise ValueError("the audit log calls another actor so, or an address; choose another")
    if re.fullmatch(r"[0-9a-f]{8}", name) or redact_keys(name) != name:
        raise ValueError("that looks like a key or a key's id; choose another")
    return name
