"""The CB link of the mock controller, over TCP and serial lines."""
