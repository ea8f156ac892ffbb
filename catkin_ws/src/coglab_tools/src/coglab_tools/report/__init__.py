"""Reports: one HTML page for a trial or a study, and the metrics in it."""
