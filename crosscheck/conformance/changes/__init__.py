"""Changes of a scene after which the motion is known: other frames, units, forms, starts and drivers."""
