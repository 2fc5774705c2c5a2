"""Questions of design about a scene: closing its loops, redundancy along its motion, exchanges of joints."""
