"""Implemented and sampled controllers, checked in time: integers, headers, held plants."""
