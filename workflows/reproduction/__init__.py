"""What ``reproduce_paper.py`` consists of.

published.py    what the paper states and what is required of truepath
simulated.py    the paper's simulated robots, moved by Drake
cases.py        one robot or one split: every way of predicting, compared with the truth
summary.py      medians and ranges over the cases, beside the paper's values
text.py         the tables for people
figures.py      errors pose by pose
"""
