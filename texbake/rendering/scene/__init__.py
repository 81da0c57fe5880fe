"""What a picture is of: camera, lights, environment, objects and materials, as plain values."""
