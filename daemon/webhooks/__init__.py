"""The MES is told: signed messages from an outbox, at least once, in order."""
