"""Session folders: written while a run captures, read by `handeyed solve`."""
