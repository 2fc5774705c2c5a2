"""A mechanism's equations in joint coordinates as symbols, for engines that generate code from them."""
