"""Drag of airframe and rotors."""
