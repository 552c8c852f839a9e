"""The fault-tolerant strategies of the thesis, compared."""
