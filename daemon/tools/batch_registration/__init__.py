"""Many scans registered again: divided among workers, each whole or not there, resumed where it stopped."""
