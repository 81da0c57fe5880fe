"""One chart laid flat with as little distortion as it can have."""
