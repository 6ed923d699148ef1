"""The application: settings, cell, runs, store, REST API, systemd and command line."""
