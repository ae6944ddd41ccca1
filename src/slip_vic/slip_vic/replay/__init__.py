"""Run the controller again on recorded inputs, and compare every command."""
