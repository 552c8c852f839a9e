"""The disc servo, which keeps the data's buffer filled (section 2.5.3)."""
