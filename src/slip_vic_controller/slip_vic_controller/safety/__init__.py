"""The layer between law and joints: validation of inputs, modes, HOLD, and limits of efforts."""
