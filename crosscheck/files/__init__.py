"""One file of a robot in many engines: the machine that each one's own reader builds, against the format."""
