"""MuJoCo stand-in for the arm, the slippery grasp and the tactile slip sensor."""
