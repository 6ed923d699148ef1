"""Pairs of poses as measurements: their residuals, what may be wrong with them, and the likeliest X.

`pose_pairs.solve.solve_hand_eye_poses` is an entry point of the library; no command and no route reaches it yet.
"""
