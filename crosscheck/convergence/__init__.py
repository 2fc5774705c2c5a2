"""Orders of convergence of engines: errors of runs at halved steps, and their page."""
