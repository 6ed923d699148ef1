"""The arm: joint angles to flange poses and back, and the dimensions of ABB's arms."""
