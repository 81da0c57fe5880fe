"""What settings are compared with: closed forms, rays from any point, slow references."""
