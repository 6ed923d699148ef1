"""The other end of every wire, with known truth: controller, arm, camera and scanner."""
