"""Webhooks: signed messages from the outbox, delivered at least once and in order."""
