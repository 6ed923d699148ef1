"""Processes of their own that show daemons over another protocol. They speak REST with the daemons, and no more."""
