"""Reports as self-contained HTML or PDF, in each language: pictures inside, print style, no script."""
