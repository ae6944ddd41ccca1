"""The control law: gains, contact, object, attitude, impedance, torque; each formula of the paper once."""
