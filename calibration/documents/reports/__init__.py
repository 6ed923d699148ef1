"""Reports as self-contained HTML: inline pictures, print style, no script. Pure functions from documents to text."""
