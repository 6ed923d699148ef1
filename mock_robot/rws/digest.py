"""HTTP Digest (RFC 2617, MD5, qop auth) as RWS 1.0 asks for it."""

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
    """Challenges that were given, and answers to them."""

    passwords: dict[str, str]
    _nonces: set[str] = field(default_factory=set, init=False)

    def challenge(self, domain: str, *, stale: bool = False) -> str:
        """The value of a WWW-Authenticate."""
        nonce = secrets.token_hex(16)
        self._nonces.add(nonce)
        return (
            f'Digest realm="{REALM}", domain="{domain}", nonce="{nonce}", opaque="799d5", algorithm="MD5", '
            f'qop="auth", stale="{"TRUE" if stale else "FALSE"}"'
        )

    def user(self, authorization: str, method: str) -> str | None:
        """Who answered a challenge rightly. The uri is hashed as it was sent: clients drop `;value` from it."""
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
        """After a restart every nonce is a stranger's."""
        self._nonces.clear()
