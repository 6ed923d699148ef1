"""The support bundle: settings, log, versions and state of a cell in one file, without secrets."""
