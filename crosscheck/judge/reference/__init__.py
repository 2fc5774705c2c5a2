"""References: the motion of any scene computed by two independent formulations, and the bound that follows
from their difference."""
