"""The cells of comparisons: one problem by one method at one accuracy level, once.

A cell is planned (`plan`), answered and certified in a worker (`answer`), and stored when it ends
(`stored`): as a results folder, or as a light record. A comparison is a view over them.
"""
