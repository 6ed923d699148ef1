"""Hand-eye calibration from pairs of poses alone: residuals, noise models, and the most likely X.

`pose_pairs.solve.solve_hand_eye_poses` is an entry point of the library; no command and no route reaches it yet.
"""
