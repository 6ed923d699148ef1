"""HTTP Digest authentication (RFC 2617, MD5, qop auth), which RWS 1.0 requires."""

import hashlib
import re
import secrets
from dataclasses import dataclass, field

REALM = "validusers@robapi.abb"
_FIELD = re.compile(r'(\w+)=(?:"([^"]*)"|([^\s,]+))')


def _md5(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


@dataclass
class DigestAuth:
    """Issued nonces, and the check of responses."""

    passwords: dict[str, str]
    _nonces: set[str] = field(default_factory=set, init=False)

    def challenge(self, domain: str, *, stale: bool = False) -> str:
        """Value of a WWW-Authenticate header."""
        nonce = secrets.token_hex(16)
        self._nonces.add(nonce)
        return (
            f'Digest realm="{REALM}", domain="{domain}", nonce="{nonce}", opaque="799d5", algorithm="MD5", '
            f'qop="auth", stale="{"TRUE" if stale else "FALSE"}"'
        )

    def user(self, authorization: str, method: str) -> str | None:
        """User of a valid response, otherwise None. The uri is hashed as received: clients omit `;value` from it."""
        scheme, _, rest = authorization.partition(" ")
        if scheme.lower() != "digest":
            return None
        said = {name: quoted or plain for name, quoted, plain in _FIELD.findall(rest)}
        user = said.get("username", "")
        if user not in self.passwords or said.get("nonce") not in self._nonces:
            return None
        secret = _md5(f"{user}:{REALM}:{self.passwords[user]}")
        request = _md5(f"{method}:{said.get('uri', '')}")
        middle = ":".join(said.get(name, "") for name in ("nonce", "nc", "cnonce", "qop"))
        right = _md5(f"{secret}:{middle}:{request}") if said.get("qop") else _md5(f"{secret}:{said['nonce']}:{request}")
        return user if secrets.compare_digest(right, said.get("response", "")) else None

    def forget(self) -> None:
        """Discard all nonces, as after a restart."""
        self._nonces.clear()
