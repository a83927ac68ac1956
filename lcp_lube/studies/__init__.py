"""Charts: runs kept in a csv, a row a run, and pictures drawn from the csv alone."""
