"""The five diodes of the pickup, as functions of focus and radial error together."""
