"""Choice of the runs of a study: settings that engines offer, a selection of them, and the order of runs."""
