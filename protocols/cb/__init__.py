"""The CB link: frames, messages and the sessions of both ends, over TCP or a serial line. See docs/cb-link.md."""
