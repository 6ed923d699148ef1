"""What every part of a service needs: clock, logs, metrics, events, worker threads, durable files, systemd."""
