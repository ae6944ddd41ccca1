"""Vendors' tactile messages to the stock messages of the controller; optional."""
