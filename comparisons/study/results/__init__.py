"""What runs found, summed up: statistics, answers, tables, exports, differences."""
