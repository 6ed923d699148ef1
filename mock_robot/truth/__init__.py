"""The cell's true transforms, and scoring of results against them."""
