"""The package under a live systemd: `make test-systemd`. Needs root, mmdebstrap and systemd-nspawn; no libraries."""
