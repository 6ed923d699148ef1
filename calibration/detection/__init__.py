"""Detection of a target's points in an image, to a fraction of a pixel; a doubtful detection is refused."""
