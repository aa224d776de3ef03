"""The neural residual: what no named cause explains, learnt by a network that differential evolution starts.

After Jiang, Yu, Jia, Zhao, Xia 2020, "Absolute Positioning Accuracy Improvement in an Industrial Robot"; equation
numbers in this package are theirs. ``network`` and ``population`` are the networks, ``evolution`` and ``training`` find
their weights, ``direct`` is the paper's own use of them, ``ensemble`` and ``reach`` truepath's, ``learning`` puts them
together and ``proof`` decides whether they are worth having.
"""
