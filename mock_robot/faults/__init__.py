"""Named faults and the board that switches them on and off."""
