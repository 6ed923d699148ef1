"""Parts of `handeyed demo`: a mock cell and a daemon as two processes, and the scenario over REST."""
