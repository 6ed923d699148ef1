"""The data channel of LMI's Gocator line profilers."""
