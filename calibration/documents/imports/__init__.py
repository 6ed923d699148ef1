"""Reads robot poses, intrinsics and whole sets as other programs write them: bytes in, typed poses out, no file opened.

`kinematics.conventions` is the table of how lengths and orientations are written, `pose_files` that of file families,
`sets` that of whole sets. `documents.readings` compares what a file leaves open by the evidence of the images.
"""
