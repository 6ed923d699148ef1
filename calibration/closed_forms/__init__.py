"""Closed-form solutions of the hand-eye problem, one module for each method.

Every method is a function `(anchor_T_mount (n, 4, 4), camera_T_target (n, 4, 4)) -> mount_T_camera (4, 4)`.
"""
