"""Session folders: written while a run captures, read when it is solved again."""
