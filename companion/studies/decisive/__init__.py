"""The decisive experiment: two recipes, trained to the end, under every stopping rule.

Recipe R is the released code's, recipe T the best settings known for each method.
"""
