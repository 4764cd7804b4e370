"""Studies: many runs declared in one file, run anywhere, kept one by one, and told with honest intervals."""
