"""The plant in a drive's loop, identified from one record by every closed-loop method."""
