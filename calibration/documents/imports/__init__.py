"""Reads robot poses, intrinsics and whole sets as other programs write them: bytes in, typed poses out, no file opened.

`conventions` is the table of how an orientation is written, `pose_files` that of file families, `sets.kinds` that of
whole sets. `readings` compares the conventions that a file leaves open by the evidence of the images.
"""
