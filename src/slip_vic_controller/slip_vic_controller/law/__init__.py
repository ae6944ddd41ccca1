"""The control law: gains, contact, object, attitude, impedance, torque; the formulas of the paper, once."""
