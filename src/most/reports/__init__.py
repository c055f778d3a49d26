"""Reports on finished runs: the paper's tables with intervals, from the runs' folders alone."""
