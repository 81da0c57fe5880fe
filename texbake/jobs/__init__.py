"""The whole job: simplify, unwrap, bake, export, preview, compare."""
