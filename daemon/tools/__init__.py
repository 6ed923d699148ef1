"""Tools of the command line that stand beside the service: archives, support bundles, printed targets."""
