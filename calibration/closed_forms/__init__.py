"""Hand-eye transforms in closed form: one module a method, all from the same two stacks of poses.

Every method is a function `(anchor_T_mount (n, 4, 4), camera_T_target (n, 4, 4)) -> mount_T_camera (4, 4)`.
"""
