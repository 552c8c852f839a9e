"""Strategy C with designed fault filters, in the loop that is closed during a defect."""
