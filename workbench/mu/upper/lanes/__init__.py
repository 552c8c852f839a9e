"""The central path of many matrices at once, each in one lane of the processor's vectors."""
