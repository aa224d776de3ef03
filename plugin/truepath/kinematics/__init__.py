"""Kinematics of many poses at once, one row of memory per quantity; ``model`` and ``inverse`` say what it means.

Arrays are ``(rows, N)``: each row holds one number of N poses side by side, so that one operation of numpy works on a
thousand poses while they are in the cache of the processor. What is computed is what ``poe``, ``motions``,
``effects`` and ``inverse`` compute for arrays ``(N, ...)``, an order of magnitude faster.
"""
