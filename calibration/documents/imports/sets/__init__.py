"""Whole sets: poses, pictures, target, camera and set-up as other programs keep them together in a folder."""
