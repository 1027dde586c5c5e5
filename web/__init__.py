"""What a person sees: the live loop, the 3D scene, panels and the page."""
