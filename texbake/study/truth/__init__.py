"""What settings are held against: closed forms, rays at any point, slow references."""
