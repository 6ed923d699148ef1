"""The instructions and functions of a controller, by what they are about."""
