"""A study's figures: which apply, what they show, how they are drawn."""
