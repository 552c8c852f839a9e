"""C99 headers of controllers: in state space, in sections, and in integers."""
