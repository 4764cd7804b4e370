"""Runs carried out, on this machine or on others, and kept one by one."""
