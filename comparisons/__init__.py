"""Studies that compare learners with the oracle, their figures and reports, and the command line."""
