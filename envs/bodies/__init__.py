"""Arms in PyBullet: scene, renderer, joint controller."""
