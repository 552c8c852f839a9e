"""The radial loop is opened, kicked across tracks, braked, and closed on another one."""
