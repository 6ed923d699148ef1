"""The commands `tip` and `touch`."""
