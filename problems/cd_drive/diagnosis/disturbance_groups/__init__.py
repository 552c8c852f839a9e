"""The four groups of disturbances of a positioning loop, including self-pollution."""
