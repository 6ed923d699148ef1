"""Tools of the command line that do not need the service: batch registration, support bundles, printed targets."""
