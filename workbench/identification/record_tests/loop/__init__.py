"""Is the loop of a record open: does the past of the outputs tell what the inputs do?"""
