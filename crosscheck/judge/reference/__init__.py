"""References: the motion of any scene by two formulations that share nothing but the scene, and its bound."""
