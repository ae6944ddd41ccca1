"""Run the controller again on recorded inputs, compare every effort, and make the reference bags."""
