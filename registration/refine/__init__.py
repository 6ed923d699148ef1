"""Fine registration: small corrections of every view, no larger than the robot's error explains."""
