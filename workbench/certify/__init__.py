"""What is trusted: code that decides whether an answer holds, and nothing else.

It imports the ground and `workbench.systems`; methods and checks import it; it imports no method.
"""
