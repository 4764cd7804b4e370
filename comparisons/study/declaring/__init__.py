"""The study file: read, checked, and made into specs of runs."""
