"""The knobs, by subject: to add one, write it in a module here and list it in `KNOB_MODULES`."""
