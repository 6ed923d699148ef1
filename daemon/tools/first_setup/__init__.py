"""A cell's first settings, by five questions: `answers.py` checks and writes them, `devices.py` asks the devices."""
