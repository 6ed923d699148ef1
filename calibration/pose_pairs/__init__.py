"""Hand-eye calibration from pairs of poses alone: residuals, noise models, and the most likely X.

`pose_pairs.solve.solve_hand_eye_poses` takes arrays, `pose_pairs.session.solve_measured_session` a session.
"""
