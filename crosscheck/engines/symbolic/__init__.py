"""A mechanism's equations in joint coordinates as symbols, for engines that make code of them."""
