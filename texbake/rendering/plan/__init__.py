"""Which effects a picture needs, and why: a scene compiled into a list of passes."""
