"""Charts joined with their neighbors, or cut to hold a bound on stretch."""
