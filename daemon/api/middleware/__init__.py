"""What every request passes: checks, authentication, idempotency."""
