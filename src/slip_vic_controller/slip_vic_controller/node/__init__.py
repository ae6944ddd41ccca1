"""The controller node: a thin shell of topics, services and publications around the session."""
