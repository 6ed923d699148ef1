"""ASGI middleware, in the order of a request: checks, authentication, idempotency."""
