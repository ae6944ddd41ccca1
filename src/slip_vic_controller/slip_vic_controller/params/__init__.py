"""Parameters of the controller, as its arms and its node have them."""
