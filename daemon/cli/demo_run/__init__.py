"""The newcomer's first minute: a mock cell and a daemon as two processes, and the main job over REST."""
