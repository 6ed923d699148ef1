"""The cell's true transforms, and scores of results against them."""
